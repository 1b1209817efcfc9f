//! How far ahead it is worth to know what will be needed, for backends that fetch what the engine foresees.
//!
//! A page comes in time if it is asked for as many frames before as a read takes, from its start to its arrival; with as many
//! again, what is needed all at once is fetched in the quiet before. How long requests have waited for their turn says
//! nothing of the store, and would have a store that can not keep up looked ahead for all the further, at a cost that grows
//! with every frame that is.
//!
//! Foreseen pages are read behind those that refused changes wait for. How long these take follows from how many wait and
//! from how many are answered in a frame while some do. Where that is longer than anybody looks ahead, nothing that is
//! foreseen comes in time, whatever it costs to find. Then nothing is looked ahead for. (To stop earlier costs misses where
//! memory is short, since what is foreseen is also what is not let go of.)

/// Frames that are looked ahead at most.
const MOST: u32 = 60;

/// What is left after a frame of the longest time that a read has taken: a half after 140 frames.
const DECAY: f64 = 0.995;

/// What is left, after a frame in which requests have waited, of what was counted in the frames before.
const FADING: f64 = 0.97;

/// Measures a store.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LookAhead {
    /// The most frames from the start of a read to its arrival lately.
    slowest: f64,
    /// Reads that have come in frames in which others waited, and such frames; older ones count less.
    came: f64,
    busy: f64,
}

impl LookAhead {
    /// A frame begins: so many reads have come since the one before, and so many requests still wait for their turn.
    pub fn begin_frame(&mut self, came: usize, waiting: usize) {
        self.slowest *= DECAY;
        if waiting > 0 {
            self.came = FADING * self.came + came as f64;
            self.busy = FADING * self.busy + 1.0;
        }
    }

    /// A read has come so many frames after it was started.
    pub fn arrived(&mut self, frames: u64) {
        self.slowest = self.slowest.max(frames as f64);
    }

    /// Frames that it takes to answer so many requests.
    fn answering(&self, requests: usize) -> f64 {
        // Before the first answer to a busy store, one is taken to be about to come.
        requests as f64 * self.busy / (self.came + 1.0)
    }

    /// For how many frames ahead to look, at least `least`; 0 for not at all. So many requests of refused changes wait for
    /// their turn.
    pub fn frames(&self, missed: usize, least: u32) -> u32 {
        if self.answering(missed) > f64::from(MOST) {
            return 0;
        }
        let read = self.slowest.ceil() as u32;
        read.saturating_mul(2).clamp(least, MOST)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_idle_store_is_looked_ahead_for_as_long_as_a_read_takes() {
        let mut ahead = LookAhead::default();
        assert_eq!(ahead.frames(0, 2), 2);
        ahead.arrived(5);
        assert_eq!(ahead.frames(0, 2), 10);
        // Without a frame in which requests had to wait, there is no telling how long many of them take.
        assert_eq!(ahead.frames(100, 2), 10);
        for _ in 0..2000 {
            ahead.begin_frame(0, 0);
        }
        assert_eq!(ahead.frames(0, 2), 2);
        ahead.arrived(1000);
        assert_eq!(ahead.frames(0, 2), MOST);
    }

    #[test]
    fn an_overloaded_store_is_not_looked_ahead_for() {
        let mut ahead = LookAhead::default();
        // Every read takes four frames, one after the other.
        for frame in 0..400 {
            ahead.begin_frame(usize::from(frame % 4 == 3), 10);
            ahead.arrived(4);
        }
        assert_eq!(ahead.frames(0, 2), 8);
        assert_eq!(ahead.frames(10, 2), 8, "ten requests take forty frames");
        assert_eq!([20, 390].map(|missed| ahead.frames(missed, 2)), [0, 0]);
        // A store that answers ten requests a frame is another matter.
        for _ in 0..400 {
            ahead.begin_frame(10, 10);
        }
        assert_eq!([390, 1000].map(|missed| ahead.frames(missed, 2)), [2, 0]);
    }
}
