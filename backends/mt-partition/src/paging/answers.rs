//! What the store answers.

use vertex_tree::NodeId;

use super::Paging;
use crate::reader::Answer;

/// A read that has failed is tried again after 1, 2, 4 ... frames, up to this many.
const LONGEST_PAUSE: u64 = 64;

impl Paging {
    pub(super) fn arrive(&mut self, answer: Answer, arrived: &mut Vec<NodeId>) {
        let unit = self.unit_of(answer.nodes.start);
        let read = self.reads.remove(&unit);
        let (waiting, is_ahead) = read.map_or((Vec::new(), true), |read| (read.waiting, read.is_ahead));
        let mut faults = 0;
        match answer.records {
            Err(_) => faults = 1,
            Ok(records) => {
                self.stats.reads += 1;
                self.stats.read_bytes += self.file.bytes(answer.nodes.clone());
                self.stats.ahead += u64::from(is_ahead);
                if let Some(foresight) = &mut self.foresight {
                    foresight.store.arrived(self.frame.saturating_sub(answer.started));
                }
                for (node, record) in answer.nodes.clone().zip(records) {
                    let Ok(record) = record else {
                        faults += 1;
                        continue;
                    };
                    let bytes = self.bytes_of(node);
                    let state = &mut self.nodes[node as usize];
                    let partition = state.partition;
                    if std::mem::take(&mut state.is_reserved)
                        || !self.residents.contains(node) && self.residents.memory().try_reserve(bytes)
                    {
                        self.residents.insert(node, record, bytes);
                        self.partitions[partition as usize].resident += 1;
                        self.mark(partition);
                        if let Some(foresight) = self.foresight.as_mut().filter(|_| is_ahead) {
                            foresight.unused.insert(node);
                        }
                        self.brought.push(node);
                    }
                }
                for group in waiting.iter().filter_map(|waiting| self.groups.get(waiting)) {
                    let is_brought = |n: &&u32| self.brought.binary_search(n).is_ok();
                    group.members.iter().filter(is_brought).for_each(|&n| self.residents.pin(n));
                }
                self.brought.clear();
            }
        }
        self.release_reserved(unit);
        if faults == 0 {
            self.failures.remove(&unit);
        } else {
            self.stats.faults += faults;
            let (times, from) = self.failures.entry(unit).or_default();
            *from = self.frame + (1_u64 << *times).min(LONGEST_PAUSE);
            *times = (*times + 1).min(LONGEST_PAUSE.ilog2());
        }
        for node in waiting {
            let Some(group) = self.groups.get_mut(&node) else { continue };
            group.reads -= 1;
            if group.reads == 0 {
                let members = self.groups.remove(&node).map(|group| group.members).unwrap_or_default();
                for n in members {
                    self.residents.unpin(n, self.frame);
                }
                arrived.push(NodeId(node));
            }
        }
    }
}
