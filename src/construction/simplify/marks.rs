//! Numbers for some of the vertices, forgotten all at once.

/// A number for each marked vertex.
#[derive(Debug)]
pub(super) struct Marks {
    /// The generation in which the mark was set, and its value.
    entries: Vec<(u32, u32)>,
    generation: u32,
}

impl Marks {
    pub fn new(count: usize) -> Marks {
        Marks { entries: vec![(0, 0); count], generation: 0 }
    }

    /// Forgets all marks.
    pub fn clear(&mut self) {
        if self.generation == u32::MAX {
            self.entries.fill((0, 0));
            self.generation = 0;
        }
        self.generation += 1;
    }

    pub fn get(&self, v: u32) -> Option<u32> {
        let (generation, value) = self.entries[v as usize];
        (generation == self.generation).then_some(value)
    }

    pub fn set(&mut self, v: u32, value: u32) {
        self.entries[v as usize] = (self.generation, value);
    }
}
