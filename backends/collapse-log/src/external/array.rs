use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};

use bytemuck::Pod;

use super::scratch::Scratch;

/// An array that is read and written by number, of which only so many bytes are in memory.
///
/// Elements lie on pages. A page that is asked for is read from a temporary file and takes the place of one that has not
/// been used for long (second chance), which is written back if it has changed. Neighbours are on the same page, so this is for
/// those who mostly ask for what is near to what they asked for before. What fits into memory never sees the file.
#[derive(Debug)]
pub struct Array<T> {
    scratch: Scratch,
    /// Made when the first page has to leave.
    file: Option<File>,
    len: usize,
    /// What elements are before they are set.
    blank: T,
    /// For each page, where it is in memory, or one of [`NOWHERE`] and [`ON_DISK`].
    places: Vec<u32>,
    frames: Vec<Frame<T>>,
    /// Pages that memory has room for.
    room: usize,
    /// The frame that is looked at next when one is wanted.
    hand: usize,
}

/// A page in memory.
#[derive(Debug)]
struct Frame<T> {
    /// [`NOWHERE`] if reading one has failed.
    page: u32,
    /// Whether it is in the file as well, perhaps as it was before.
    stored: bool,
    changed: bool,
    used: bool,
    elements: Box<[T]>,
}

/// The page has never been written: all of its elements are blank.
const NOWHERE: u32 = u32::MAX;
/// The page is in the file alone.
const ON_DISK: u32 = u32::MAX - 1;

/// About how many bytes a page has.
const PAGE_BYTES: usize = 4096;

impl<T: Pod> Array<T> {
    /// Elements of a page, a power of two.
    const PAGE: usize = {
        let fit = PAGE_BYTES / size_of::<T>();
        if fit < 2 { 1 } else { 1 << fit.ilog2() }
    };
    const SHIFT: u32 = Self::PAGE.trailing_zeros();

    /// So many blank elements, of which about `bytes` bytes are kept in memory.
    #[must_use]
    pub fn new(scratch: &Scratch, len: usize, blank: T, bytes: usize) -> Self {
        let room = (bytes / (Self::PAGE * size_of::<T>())).clamp(4, ON_DISK as usize);
        Self {
            scratch: scratch.clone(),
            file: None,
            len,
            blank,
            places: vec![NOWHERE; len.div_ceil(Self::PAGE)],
            frames: Vec::new(),
            room,
            hand: 0,
        }
    }

    /// How many elements there are.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// The element with a number.
    ///
    /// # Errors
    /// What the operating system says, and [`io::ErrorKind::UnexpectedEof`] if there are not so many.
    #[inline]
    pub fn get(&mut self, number: usize) -> io::Result<T> {
        let frame = self.frame(number)?;
        Ok(frame.elements[number & (Self::PAGE - 1)])
    }

    /// The element with a number, to be changed.
    ///
    /// # Errors
    /// As for [`get`](Self::get).
    #[inline]
    pub fn get_mut(&mut self, number: usize) -> io::Result<&mut T> {
        let frame = self.frame(number)?;
        frame.changed = true;
        Ok(&mut frame.elements[number & (Self::PAGE - 1)])
    }

    /// Sets the element with a number.
    ///
    /// # Errors
    /// As for [`get`](Self::get).
    #[inline]
    pub fn set(&mut self, number: usize, value: T) -> io::Result<()> {
        *self.get_mut(number)? = value;
        Ok(())
    }

    /// Adds an element at the end.
    ///
    /// # Errors
    /// What the operating system says.
    #[inline]
    pub fn push(&mut self, value: T) -> io::Result<()> {
        if self.len & (Self::PAGE - 1) == 0 {
            self.places.push(NOWHERE);
        }
        self.len += 1;
        self.set(self.len - 1, value)
    }

    #[inline]
    fn frame(&mut self, number: usize) -> io::Result<&mut Frame<T>> {
        if number >= self.len {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut place = self.places[number >> Self::SHIFT];
        if place >= ON_DISK {
            place = self.bring(number >> Self::SHIFT)?;
        }
        let frame = &mut self.frames[place as usize];
        frame.used = true;
        Ok(frame)
    }

    /// Puts a page into memory.
    #[cold]
    fn bring(&mut self, page: usize) -> io::Result<u32> {
        let place = if self.frames.len() < self.room {
            let elements = vec![self.blank; Self::PAGE].into_boxed_slice();
            self.frames.push(Frame { page: NOWHERE, stored: false, changed: false, used: false, elements });
            self.frames.len() - 1
        } else {
            self.make_room()?
        };
        let frame = &mut self.frames[place];
        frame.stored = self.places[page] == ON_DISK;
        match &mut self.file {
            Some(file) if frame.stored => {
                file.seek(SeekFrom::Start(Self::offset(page)))?;
                file.read_exact(bytemuck::cast_slice_mut(&mut frame.elements))?;
            }
            _ => frame.elements.fill(self.blank),
        }
        (frame.page, frame.changed) = (page as u32, false);
        self.places[page] = place as u32;
        Ok(place as u32)
    }

    /// A frame without a page.
    fn make_room(&mut self) -> io::Result<usize> {
        loop {
            let place = self.hand;
            self.hand = (self.hand + 1) % self.frames.len();
            let frame = &mut self.frames[place];
            if std::mem::take(&mut frame.used) {
                continue;
            }
            let Some(left) = self.places.get_mut(frame.page as usize) else { return Ok(place) };
            if frame.changed {
                let file = match &mut self.file {
                    Some(file) => file,
                    None => self.file.insert(self.scratch.file()?),
                };
                file.seek(SeekFrom::Start(Self::offset(frame.page as usize)))?;
                file.write_all(bytemuck::cast_slice(&frame.elements))?;
                frame.stored = true;
            }
            *left = if frame.stored { ON_DISK } else { NOWHERE };
            frame.page = NOWHERE;
            return Ok(place);
        }
    }

    fn offset(page: usize) -> u64 {
        (page * Self::PAGE * size_of::<T>()) as u64
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Whatever is written, pushed and read, it is as an array in memory.
        #[test]
        fn it_is_an_array(
            len in 0_usize..3000,
            steps in prop::collection::vec((0_u8..4, any::<u32>(), any::<u32>()), 0..4000),
            pages in 0_usize..12,
        ) {
            let scratch = Scratch { folder: std::env::temp_dir() };
            let blank = [7, 8, 9_u32];
            let mut array = Array::new(&scratch, len, blank, pages * PAGE_BYTES);
            let mut model = vec![blank; len];
            for (what, at, value) in steps {
                let at = at as usize % (model.len() + 1);
                match what {
                    0 => {
                        array.push([value; 3]).unwrap();
                        model.push([value; 3]);
                    }
                    1 if at < model.len() => {
                        array.get_mut(at).unwrap()[1] = value;
                        model[at][1] = value;
                    }
                    _ => prop_assert_eq!(array.get(at).ok(), model.get(at).copied()),
                }
            }
            prop_assert_eq!(array.len(), model.len());
            for (i, &element) in model.iter().enumerate() {
                prop_assert_eq!(array.get(i).unwrap(), element);
            }
        }
    }

    /// Of the pages in memory, one that has been asked for since the hand last passed stays.
    #[test]
    fn a_page_that_is_used_has_a_second_chance() {
        let mut array = Array::new(&Scratch { folder: std::env::temp_dir() }, 10_000, 0_u64, 0);
        let page = Array::<u64>::PAGE;
        let held = |array: &Array<u64>| {
            let in_memory = |&page: &usize| array.places[page] < ON_DISK;
            (0..8).filter(in_memory).collect::<Vec<_>>()
        };
        for used in 0..4 {
            array.set(used * page, 1).unwrap();
        }
        assert_eq!((array.room, held(&array)), (4, vec![0, 1, 2, 3]));
        // All have been used: the hand goes round, and the first page has had its chance.
        array.get(4 * page).unwrap();
        assert_eq!(held(&array), [1, 2, 3, 4]);
        for used in [1, 3] {
            array.get(used * page).unwrap();
        }
        array.get(5 * page).unwrap();
        assert_eq!(held(&array), [1, 3, 4, 5], "page 2 has not been used since");
        array.get(6 * page).unwrap();
        assert_eq!(held(&array), [3, 4, 5, 6], "page 1 has had its chance, and has not been used since");
    }

    #[test]
    fn without_a_folder_it_says_so() {
        let mut array = Array::new(&Scratch { folder: "/nowhere/at/all".into() }, 100_000, 0_u64, 0);
        assert!((0..100_000).try_for_each(|i| array.set(i, 1)).is_err());
        assert!(array.get(100_000).is_err());
    }
}
