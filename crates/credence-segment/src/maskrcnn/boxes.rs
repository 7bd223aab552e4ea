//! Boxes in the image, and how the heads tell of them.

use credence_nn::rgbd::{HEIGHT, WIDTH};

/// Left, top, right and bottom edge, pixels; the centre of the first pixel is (0, 0), so that the
/// box of one pixel reaches from -0.5 to 0.5.
pub type Edges = [f32; 4];

/// Largest logarithm of a growth that is told, as in torchvision: 1000/16.
const MOST_GROWTH: f32 = 4.135_166_5;

/// Sides of a box.
pub const fn sides([left, top, right, bottom]: Edges) -> [f32; 2] {
    [right - left, bottom - top]
}

const fn centre([left, top, right, bottom]: Edges) -> [f32; 2] {
    [f32::midpoint(left, right), f32::midpoint(top, bottom)]
}

/// A box as told from another (Girshick et al. 2014): the shift of its centre in sides of the
/// other, and the logarithms of its sides in sides of the other; each in its `unit`.
pub fn encode(from: Edges, to: Edges, unit: [f32; 2]) -> [f32; 4] {
    let ([fx, fy], [tx, ty]) = (centre(from), centre(to));
    let ([fw, fh], [tw, th]) = (sides(from), sides(to));
    [
        (tx - fx) / fw / unit[0],
        (ty - fy) / fh / unit[0],
        (tw / fw).ln() / unit[1],
        (th / fh).ln() / unit[1],
    ]
}

/// The box that is told from another.
pub fn decode(from: Edges, told: [f32; 4], unit: [f32; 2]) -> Edges {
    let ([x, y], [w, h]) = (centre(from), sides(from));
    let middle = [x + told[0] * unit[0] * w, y + told[1] * unit[0] * h];
    let grown = |side: f32, told: f32| side * (told * unit[1]).min(MOST_GROWTH).exp() / 2.0;
    let half = [grown(w, told[2]), grown(h, told[3])];
    [
        middle[0] - half[0],
        middle[1] - half[1],
        middle[0] + half[0],
        middle[1] + half[1],
    ]
}

/// What of a box is in the image.
pub fn clip(edges: Edges) -> Edges {
    let [left, top, right, bottom] = edges;
    let across = |at: f32| at.clamp(-0.5, WIDTH as f32 - 0.5);
    let down = |at: f32| at.clamp(-0.5, HEIGHT as f32 - 0.5);
    [across(left), down(top), across(right), down(bottom)]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_box_twice_as_wide_and_half_a_side_lower_by_hand() {
        let from = [0.0, 0.0, 10.0, 20.0];
        let to = [-5.0, 10.0, 15.0, 30.0];
        let told = encode(from, to, [0.1, 0.2]);
        let expected = [0.0, 5.0, 2.0_f32.ln() * 5.0, 0.0];
        assert!(told.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5));
    }

    #[test]
    fn a_box_is_cut_at_the_pixels_edges() {
        assert_eq!(
            clip([-9.0, 5.0, 400.0, 300.0]),
            [-0.5, 5.0, WIDTH as f32 - 0.5, HEIGHT as f32 - 0.5]
        );
    }

    fn edges() -> impl Strategy<Value = Edges> {
        let (at, side) = (-50.0_f32..300.0, 2.0_f32..200.0);
        (at.clone(), at, side.clone(), side).prop_map(|(x, y, w, h)| [x, y, x + w, y + h])
    }

    proptest! {
        #[test]
        fn decoding_undoes_encoding(from in edges(), to in edges()) {
            let told = encode(from, to, [0.1, 0.2]);
            // Within what may be told.
            prop_assume!(told[2..].iter().all(|growth| growth * 0.2 < MOST_GROWTH));
            let back = decode(from, told, [0.1, 0.2]);
            for (a, b) in back.iter().zip(to) {
                prop_assert!((a - b).abs() < 0.01, "{back:?} is not {to:?}");
            }
        }
    }
}
