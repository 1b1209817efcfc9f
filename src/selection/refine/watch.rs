//! How a strategy is told of what comes and goes.

use vertex_tree::Bounds;

use super::frame::Frame;
use crate::in_play::{Kind, Slot};

/// A strategy's state, as the part of the engine that carries out changes sees it. Several of these calls are made for every
/// change.
///
/// The engine tells of every node that becomes or ceases to be a boundary node or collapsible, so that a strategy can
/// watch just these.
pub(crate) trait Watch {
    /// The node has become a boundary node or collapsible; the criterion does not ask for it to change.
    fn watch(&mut self, frame: &Frame, slot: Slot, kind: Kind, bounds: Bounds);

    /// The node is no longer what it was watched as, if it was watched.
    fn unwatch(&mut self, slot: Slot);

    /// The same for a node whose status has just changed: what it was watched for has come up.
    #[inline(always)]
    fn changed(&mut self, slot: Slot) {
        self.unwatch(slot);
    }

    /// The node should have changed, but the backend refused for now: it must be found again in the next frame, even
    /// if nothing moves.
    fn refused(&mut self, slot: Slot, kind: Kind, bounds: Bounds);

    /// Starts to read into the cache what [`unwatch`](Self::unwatch) and [`watch`](Self::watch) will touch.
    #[inline(always)]
    fn prefetch(&self, slot: Slot) {
        let _ = slot;
    }
}
