//! How many candidates there are for every key, and from that the limit of a round.
//!
//! A round takes up the cheaper half of the candidates. Which key divides them need not be known to the last bit, and
//! where the mesh is larger than memory the keys can not be selected from either: they are counted in classes of the
//! same exponent and the same first eight bits of the mantissa, which differ by less than half a percent.

/// Bits of a key that do not tell classes apart.
const DROPPED_BITS: u32 = 15;
/// Keys are not negative, so the sign bit is not there. Infinity is beyond the last class.
const CLASSES: usize = (f32::INFINITY.to_bits() >> DROPPED_BITS) as usize;
/// Candidates that a round takes up at least, if there are as many.
const LEAST: u64 = 16;

/// Numbers of candidates in classes of nearly equal keys.
#[derive(Clone, Debug)]
pub(super) struct KeyCounts {
    counts: Vec<u32>,
    all: u64,
    /// Of vertices that had no edge to collapse when they were last looked at, but may have one now.
    unknown: u64,
}

impl Default for KeyCounts {
    fn default() -> Self {
        KeyCounts { counts: vec![0; CLASSES], all: 0, unknown: 0 }
    }
}

impl KeyCounts {
    pub fn add(&mut self, key: f32) {
        match self.counts.get_mut(class(key)) {
            Some(count) => (*count, self.all) = (*count + 1, self.all + 1),
            None => self.unknown += 1,
        }
    }

    /// Takes away a key that has been added before.
    pub fn remove(&mut self, key: f32) {
        match self.counts.get_mut(class(key)) {
            Some(count) => (*count, self.all) = (*count - 1, self.all - 1),
            None => self.unknown -= 1,
        }
    }

    /// The largest key of the class in which the median lies. Where nothing is known, a round without collapses will tell.
    pub fn limit(&self) -> Option<f32> {
        if self.all == 0 {
            return (self.unknown > 0).then_some(0.0);
        }
        let wanted = (self.all / 2).max(self.all.min(LEAST));
        let mut below = 0;
        let class = self.counts.iter().position(|&count| {
            below += u64::from(count);
            below >= wanted
        })?;
        Some(f32::from_bits(((class as u32 + 1) << DROPPED_BITS) - 1))
    }
}

fn class(key: f32) -> usize {
    (key.to_bits() >> DROPPED_BITS) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_limit_is_just_above_the_median() {
        let mut counts = KeyCounts::default();
        assert_eq!(counts.limit(), None);
        (1..=1000_u16).for_each(|key| counts.add(f32::from(key)));
        let limit = counts.limit().unwrap();
        assert!((500.0..=502.0).contains(&limit), "{limit}");
        (1..=400_u16).for_each(|key| counts.remove(f32::from(key)));
        let limit = counts.limit().unwrap();
        assert!((700.0..=703.0).contains(&limit), "{limit}");
    }

    #[test]
    fn few_candidates_are_all_taken_up() {
        let mut counts = KeyCounts::default();
        (0..16_u16).for_each(|key| counts.add(f32::from(key)));
        assert!(counts.limit().unwrap() >= 15.0);
        for _ in 0..100 {
            counts.add(f32::INFINITY);
        }
        assert!(counts.limit().unwrap() < 16.0);
        (0..16_u16).for_each(|key| counts.remove(f32::from(key)));
        assert_eq!(counts.limit(), Some(0.0));
        for _ in 0..100 {
            counts.remove(f32::INFINITY);
        }
        assert_eq!(counts.limit(), None);
        counts.add(f32::MAX);
        assert_eq!(counts.limit(), Some(f32::MAX));
    }
}
