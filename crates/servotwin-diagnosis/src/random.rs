//! A small seeded random number generator: xoshiro256++ filled by splitmix64.
//!
//! Written from the public description of both generators (Blackman and Vigna, "Scrambled linear
//! pseudorandom number generators", 2021). Not for secrets. The sequence for a seed is part of the
//! crate's promise: models trained with the same seed stay the same.

/// A seeded sequence of random numbers.
#[derive(Debug, Clone)]
pub struct Random {
    state: [u64; 4],
}

/// One step of splitmix64: advances `counter` and returns its scrambled value.
fn splitmix64(counter: &mut u64) -> u64 {
    *counter = counter.wrapping_add(0x9E37_79B9_7F4A_7C15);
    let mut mixed = *counter;
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    mixed ^ (mixed >> 31)
}

impl Random {
    /// The sequence of a seed. Every seed is good, zero included.
    pub fn new(seed: u64) -> Self {
        let mut counter = seed;
        Random { state: core::array::from_fn(|_| splitmix64(&mut counter)) }
    }

    /// The sequence number `stream` of a seed, independent of all other streams.
    ///
    /// Each tree of a forest and each repetition of a split takes its own stream, so that they can run in any order.
    pub fn stream(seed: u64, stream: u64) -> Self {
        let mut counter = stream;
        Random::new(seed ^ splitmix64(&mut counter))
    }

    /// The next 64 random bits.
    pub fn next_u64(&mut self) -> u64 {
        let s = &mut self.state;
        let result = s[0].wrapping_add(s[3]).rotate_left(23).wrapping_add(s[0]);
        let shifted = s[1] << 17;
        s[2] ^= s[0];
        s[3] ^= s[1];
        s[1] ^= s[2];
        s[0] ^= s[3];
        s[2] ^= shifted;
        s[3] = s[3].rotate_left(45);
        result
    }

    /// A number in `[0, 1)` with 53 random bits.
    pub fn unit(&mut self) -> f64 {
        (self.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A number in `[low, high)`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// An index in `0..length`, each equally likely; `0` when `length` is `0`.
    ///
    /// Multiply-and-reject (Lemire 2019), free of the modulo bias.
    pub fn index(&mut self, length: usize) -> usize {
        let length = length as u64;
        if length == 0 {
            return 0;
        }
        let biased = length.wrapping_neg() % length;
        loop {
            let product = u128::from(self.next_u64()) * u128::from(length);
            if product as u64 >= biased {
                return (product >> 64) as usize;
            }
        }
    }

    /// Puts the items into a random order (Fisher and Yates).
    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for last in (1..items.len()).rev() {
            let other = self.index(last + 1);
            items.swap(last, other);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::Random;

    #[test]
    fn first_numbers_of_the_published_reference() {
        // splitmix64 with seed 1234567: the values printed with the public reference code.
        let mut counter = 1_234_567;
        assert_eq!(super::splitmix64(&mut counter), 6_457_827_717_110_365_317);
        assert_eq!(super::splitmix64(&mut counter), 3_203_168_211_198_807_973);
        // xoshiro256++ from the state 1, 2, 3, 4.
        let mut random = Random { state: [1, 2, 3, 4] };
        assert_eq!(random.next_u64(), 41_943_041);
        assert_eq!(random.next_u64(), 58_720_359);
    }

    #[test]
    fn indices_are_in_range_and_even() {
        let mut random = Random::new(7);
        let mut hits = [0u32; 6];
        for _ in 0..60_000 {
            hits[random.index(6)] += 1;
        }
        assert!(hits.iter().all(|&count| (9_500..10_500).contains(&count)), "{hits:?}");
        assert_eq!(random.index(0), 0);
        assert_eq!(random.index(1), 0);
    }

    #[test]
    fn shuffling_keeps_every_item() {
        let mut items: [usize; 50] = core::array::from_fn(|index| index);
        Random::new(1).shuffle(&mut items);
        assert!(items.iter().enumerate().any(|(place, &item)| place != item));
        items.sort_unstable();
        assert!(items.iter().enumerate().all(|(place, &item)| place == item));
    }

    #[test]
    fn streams_differ() {
        let first = Random::stream(3, 0).next_u64();
        assert_ne!(first, Random::stream(3, 1).next_u64());
        assert_ne!(first, Random::stream(4, 0).next_u64());
    }
}
