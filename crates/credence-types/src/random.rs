use std::cmp::Ordering;

use rand::seq::SliceRandom as _;
use rand_chacha::{ChaCha20Rng, rand_core::SeedableRng as _};

use crate::Point;

/// The random numbers of one seed and purpose.
pub type Stream = ChaCha20Rng;

/// A random stream of its own per seed and purpose, so that no draw shifts another's.
///
/// The cipher's key is the seed and the purpose's first 24 bytes; a longer purpose also selects
/// the cipher's stream by its FNV-1a hash, so that names with a common beginning stay apart.
pub fn stream(seed: u64, purpose: &str) -> Stream {
    let mut key = [0; 32];
    let room = key.len() - size_of::<u64>();
    let bytes = seed.to_le_bytes().into_iter().chain(purpose.bytes());
    for (slot, byte) in key.iter_mut().zip(bytes) {
        *slot = byte;
    }
    let mut rng = ChaCha20Rng::from_seed(key);
    if purpose.len() > room {
        rng.set_stream(fnv_1a(purpose));
    }
    rng
}

/// At most `most` of the points, in an order that is random, by the purpose, but does not depend on
/// theirs.
pub fn thinned(points: &[Point], most: usize, purpose: &str) -> Vec<Point> {
    let mut points = points.to_vec();
    points.sort_unstable_by(|a, b| {
        let by_axis = (0..3).map(|axis| a[axis].total_cmp(&b[axis]));
        by_axis.fold(Ordering::Equal, Ordering::then)
    });
    let (chosen, _) = points.partial_shuffle(&mut stream(0, purpose), most);
    chosen.to_vec()
}

/// The 64-bit FNV-1a hash (Fowler, Noll and Vo): the same on every machine and version.
fn fnv_1a(text: &str) -> u64 {
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use rand_chacha::rand_core::Rng as _;

    use super::*;

    #[test]
    fn seed_and_whole_purpose_select_the_stream() {
        let first = |seed, purpose| stream(seed, purpose).next_u64();
        assert_eq!(first(1, "map/free-space"), first(1, "map/free-space"));
        assert_ne!(first(1, "map/free-space"), first(2, "map/free-space"));
        assert_ne!(first(1, "a"), first(1, "b"));
        let common = "pipeline/training/observed-points";
        assert_ne!(first(1, common), first(1, &format!("{common}-2")));
    }

    #[test]
    fn thinning_is_random_but_for_the_order_of_the_points() {
        let points: Vec<Point> = (0..50)
            .map(|i| Point::new(f64::from(i), 0.0, 0.0))
            .collect();
        let some = thinned(&points, 20, "test");
        let reversed: Vec<Point> = points.iter().rev().copied().collect();
        assert_eq!(thinned(&reversed, 20, "test"), some);
        assert_ne!(thinned(&points, 20, "other"), some);
        assert!(some.len() == 20 && some.iter().all(|point| points.contains(point)));
        let mut all = thinned(&points, 99, "test");
        assert_ne!(all, points);
        all.sort_unstable_by(|a, b| a.x.total_cmp(&b.x));
        assert_eq!(all, points);
    }

    #[test]
    fn the_hash_is_the_published_one() {
        assert_eq!(fnv_1a(""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv_1a("foobar"), 0x8594_4171_f739_67e8);
    }
}
