//! Numbers in the order of a key.

/// Numbers in the order of a key; of one key in the order in which they came. One piece of code for all kinds of order, so that
/// it is there once.
pub(crate) fn by_key(
    numbers: impl IntoIterator<Item = u32>,
    key: impl Fn(u32) -> [u64; 2],
) -> Vec<u32> {
    let keyed = numbers.into_iter().zip(0..).map(|(number, place)| (key(number), place, number));
    let mut all: Vec<([u64; 2], u32, u32)> = keyed.collect();
    // No two are equal, so that the order is one whatever the sort does.
    all.sort_unstable();
    all.into_iter().map(|(_, _, number)| number).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_one_key_stay_as_they_came() {
        let sorted = by_key([7, 3, 9, 4, 1, 8], |number| [u64::from(number % 3), 0]);
        assert_eq!(sorted, [3, 9, 7, 4, 1, 8]);
        assert_eq!(by_key([2, 1, 0], |number| [0, u64::from(number)]), [0, 1, 2]);
    }
}
