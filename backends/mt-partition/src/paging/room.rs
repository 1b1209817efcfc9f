//! Makes room.
//!
//! What is needed last goes first: of what is not foreseen, that which no cut holds, least recently used first, then what
//! some cut holds, then what is foreseen, the farthest first, requests for it included.

use super::Paging;
use super::change::Need;

impl Paging {
    /// Reserves room for those of some nodes that have none yet, and makes some if there is none. If that is not possible,
    /// returns how many bytes it takes.
    pub(super) fn reserve(&mut self, nodes: &[u32], need: Need) -> Result<(), u64> {
        let bytes = self.nodes.unreserved_bytes(nodes);
        while !self.nodes.residents.memory().try_reserve(bytes) {
            if !self.let_go_of_one(need) {
                return Err(bytes);
            }
        }
        // Making room may have withdrawn a request that had room for some of them.
        if self.nodes.unreserved_bytes(nodes) > bytes {
            self.nodes.residents.memory().release(bytes);
            return self.reserve(nodes, need);
        }
        nodes.iter().for_each(|&n| self.nodes.reserve(n));
        Ok(())
    }

    fn let_go_of_one(&mut self, need: Need) -> bool {
        let foresight = &self.foresight;
        let is_foreseen = |n: u32| foresight.as_ref().is_some_and(|f| f.is_named(n));
        let mut node = self.nodes.oldest(self.frame, is_foreseen);
        if node.is_none() && need != Need::Change {
            node = self.nodes.residents.any(self.frame, is_foreseen);
        }
        if let Some(node) = node {
            self.let_go(node);
            return true;
        }
        let earliest = match need {
            Need::Change => return false,
            Need::Pressing => 0,
            Need::Foreseen(frame) => frame + 1,
        };
        while let Some(node) = self.foresight.as_mut().and_then(|f| f.next_farthest(earliest)) {
            if self.nodes.residents.is_free(node, self.frame) {
                self.let_go(node);
                return true;
            }
            if self.nodes.is_reserved(node) && self.withdraw(self.nodes.unit_of(node)) {
                return true;
            }
        }
        false
    }

    pub(super) fn let_go(&mut self, node: u32) {
        self.nodes.let_go(node);
        if let Some(foresight) = &mut self.foresight {
            foresight.unused.remove(&node);
        }
    }

    /// Makes room where the limit has been lowered, or where another tree could not have what it wants.
    pub(super) fn relieve(&mut self) {
        let mut excess = self.nodes.residents.memory().excess(self.member);
        self.pressed = if excess > 0 { self.pressed + 1 } else { 0 };
        while excess > 0 {
            let memory = self.nodes.residents.memory();
            let is_pressing = self.pressed > 1 || memory.used() > memory.limit();
            if !self.let_go_of_one(if is_pressing { Need::Pressing } else { Need::Change }) {
                break;
            }
            excess = self.nodes.residents.memory().excess(self.member);
        }
    }
}
