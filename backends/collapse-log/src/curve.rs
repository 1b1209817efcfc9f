/// The place of a cell on the Z-order curve (Morton 1966) through a grid of 1024 cells a side: the bits of its three
/// coordinates in turns.
#[must_use]
pub fn z_order(cell: [u32; 3]) -> u32 {
    let [x, y, z] = cell.map(spread);
    x | y << 1 | z << 2
}

/// Puts two zero bits between each of the lowest 10 bits.
fn spread(x: u32) -> u32 {
    let x = x & 0x3ff;
    let x = (x | x << 16) & 0x0300_00ff;
    let x = (x | x << 8) & 0x0300_f00f;
    let x = (x | x << 4) & 0x030c_30c3;
    (x | x << 2) & 0x0924_9249
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_come_in_turns() {
        assert_eq!(z_order([0b11, 0, 0]), 0b1001);
        assert_eq!(z_order([0, 0b101, 0]), 0b1000_0010);
        assert_eq!(z_order([1, 1, 1]), 0b111);
        assert_eq!(z_order([1023; 3]), (1 << 30) - 1);
    }
}
