//! A merge-tree node as stored (section 3.4 of the paper).
//!
//! ```text
//! plain, 52 bytes                                    quantised, 30 bytes
//! offset  bytes  field                               offset  bytes  field
//!      0     12  position x y z, f32                      0      8  position, 19 bits a coordinate; above
//!                                                                  them the sine of the normal cone in 126ths
//!     12     12  normal x y z, f32                        8      2  normal on an octahedron
//!     24      4  radius of the bounding sphere, f32      10      2  radius, a float of 5 + 11 bits
//!     28      4  sine of the normal cone, f32            12      2  eps, likewise
//!     32     16  half-edges w x y z, u32 each            14     16  half-edges w x y z, u32 each
//!     48      4  geometric error eps, f32
//! ```
//!
//! Position and normal are those of the vertex that the node brings back when it is unfolded, and the sphere is centred
//! there. The last four bytes hold the node's number in the global order of collapses in the paper, where it prevents
//! fold-overs; here dependencies do, and eps takes its place. A sine above 1 says that there is no cone: the normals below
//! the node are spread over half of all directions or more.

use vertex_tree::{Bounds, NormalCone};

use crate::quantize::{self, Scale};

/// Bytes of a node.
pub(crate) const PLAIN_BYTES: usize = 52;
/// Bytes of a quantised node.
pub(crate) const QUANTISED_BYTES: usize = 30;
/// What is stored of a node, decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stored {
    pub position: [f32; 3],
    pub normal: [f32; 3],
    pub radius: f32,
    pub sine: f32,
    /// w x y z, in the file's numbers.
    pub adjacent: [u32; 4],
    pub eps: f32,
}

impl Stored {
    pub fn bounds(&self) -> Bounds {
        Bounds { center: self.position, radius: self.radius, eps: self.eps }
    }

    pub fn cone(&self) -> NormalCone {
        NormalCone { axis: self.normal, sine: self.sine }
    }

    /// Whether the numbers are such as a builder writes.
    pub fn is_sane(&self) -> bool {
        let length = |x: f32| x.is_finite() && x >= 0.0;
        self.position.iter().chain(&self.normal).all(|x| x.is_finite())
            && length(self.radius)
            && length(self.eps)
            && length(self.sine)
    }

    /// Appends the node. Lengths that are too large for small floats are the builder's to exclude.
    pub fn encode(&self, quantised: Option<&Scale>, out: &mut Vec<u8>) {
        match quantised {
            None => {
                for x in self.position.iter().chain(&self.normal).chain(&[self.radius, self.sine]) {
                    out.extend_from_slice(&x.to_le_bytes());
                }
            }
            Some(scale) => {
                let length = |x| scale.length(x).unwrap_or(u16::MAX).to_le_bytes();
                let code = scale.position(self.position) | quantize::sine(self.sine);
                out.extend_from_slice(&code.to_le_bytes());
                out.extend_from_slice(&quantize::normal(self.normal).to_le_bytes());
                out.extend_from_slice(&length(self.radius));
                out.extend_from_slice(&length(self.eps));
            }
        }
        for h in self.adjacent {
            out.extend_from_slice(&h.to_le_bytes());
        }
        if quantised.is_none() {
            out.extend_from_slice(&self.eps.to_le_bytes());
        }
    }

    /// Reads a node from as many bytes as one has.
    pub fn decode(quantised: Option<&Scale>, bytes: &[u8]) -> Self {
        let word = |at: usize| u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        let half = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let float = |at: usize| f32::from_bits(word(at));
        let four = |at: usize| std::array::from_fn(|i| word(at + 4 * i));
        match quantised {
            None => Self {
                position: [float(0), float(4), float(8)],
                normal: [float(12), float(16), float(20)],
                radius: float(24),
                sine: float(28),
                adjacent: four(32),
                eps: float(48),
            },
            Some(scale) => {
                let code = u64::from(word(4)) << 32 | u64::from(word(0));
                Self {
                    position: scale.point(code),
                    normal: quantize::decode_normal(half(8)),
                    sine: quantize::decode_sine(code),
                    radius: scale.decode_length(half(10)),
                    eps: scale.decode_length(half(12)),
                    adjacent: four(14),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cone::NO_CONE;

    #[test]
    fn nodes_have_the_promised_size_and_come_back() {
        let scale = Scale::new([0.0; 3], [4.0; 3]);
        let node = Stored {
            position: scale.point(scale.position([1.0, 2.0, 3.0])),
            normal: quantize::decode_normal(quantize::normal([0.6, 0.0, 0.8])),
            radius: 0.5,
            sine: NO_CONE,
            adjacent: [7, 8, u32::MAX, 1 << 31],
            eps: 0.0,
        };
        for (quantised, bytes) in [(None, PLAIN_BYTES), (Some(&scale), QUANTISED_BYTES)] {
            let mut out = Vec::new();
            node.encode(quantised, &mut out);
            assert_eq!(out.len(), bytes);
            assert_eq!(Stored::decode(quantised, &out), node);
        }
    }
}
