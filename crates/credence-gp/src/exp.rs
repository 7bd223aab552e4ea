//! exp(-x) as straight-line arithmetic, which the compiler can vectorise; the library's is a call.

use std::f64::consts::LOG2_E;

/// 1.5 * 2^52: adding it rounds to an integer, held in the low bits of the sum.
const ROUND: f64 = 6_755_399_441_055_744.0;

/// ln 2 in two parts; the first ends in 21 zero bits, so its multiples by n are exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;

/// exp(-x) for 0 <= x <= 700, within 2 units in the last place; other x are the caller's fault.
///
/// With n = round(-x / ln 2): exp(-x) = 2^n exp(r), |r| <= ln 2 / 2, and exp(r) by its Taylor
/// series to r^13, whose rest is below 5e-18.
#[expect(
    clippy::inline_always,
    reason = "a helper that is not inlined keeps the baseline's narrow vectors"
)]
#[inline(always)]
pub(crate) fn exp_neg(x: f64) -> f64 {
    let shifted = ROUND - x * LOG2_E;
    let n = shifted - ROUND;
    let r = (-x - n * LN_2_HIGH) - n * LN_2_LOW;
    let mut series = 1.0 / 6_227_020_800.0;
    for reciprocal in [
        1.0 / 479_001_600.0,
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        0.5,
        1.0,
        1.0,
    ] {
        series = series * r + reciprocal;
    }
    let power = f64::from_bits(shifted.to_bits().wrapping_add(1023) << 52);
    series * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_library_within_2_units_in_the_last_place() {
        for i in 0..700_000 {
            let x = f64::from(i) * 1e-3 + 1e-7;
            let (ours, theirs) = (exp_neg(x), (-x).exp());
            assert!(
                (ours - theirs).abs() <= 2.0 * f64::EPSILON * theirs,
                "exp(-{x}) = {ours:e}, library {theirs:e}"
            );
        }
        assert_eq!(exp_neg(0.0), 1.0);
    }
}
