//! A scene as bytes: fixed-point numbers of 16 bits, little-endian.
//!
//! Category (u8), number of object, neighbour, free, query and surrounding points (u16 each),
//! viewpoint (3 f32), then the points, three u16 each, in that order, the surface's points nearest to
//! the last two kinds, the neighbours' categories (u8) and the queries' distances (u16).

use credence_types::Category;

use super::Scene;

/// Resolution of coordinates and distances. The sensor's noise is twenty times that.
const STEP_M: f32 = 5e-5;
/// Code of coordinate 0; the range is -1.6 m to 1.6 m.
const ZERO: f32 = 32768.0;
const HEADER_BYTES: usize = 1 + 5 * 2 + 3 * 4;

/// Appends a scene, its coordinates rounded and cut to the range.
pub(super) fn encode(scene: &Scene, bytes: &mut Vec<u8>) {
    let Scene {
        category,
        object,
        neighbours,
        free,
        viewpoint,
        queries,
        distances_m,
        surroundings,
        nearest,
    } = scene;
    bytes.push(category.class());
    for points in [
        object.len(),
        neighbours.len(),
        free.len(),
        queries.len(),
        surroundings.len(),
    ] {
        bytes.extend((points as u16).to_le_bytes());
    }
    bytes.extend(viewpoint.iter().flat_map(|c| c.to_le_bytes()));
    let neighbour_points = neighbours.iter().map(|(point, _)| point);
    let points = object
        .iter()
        .chain(neighbour_points)
        .chain(free)
        .chain(queries)
        .chain(surroundings)
        .chain(nearest);
    let coordinates = points.flatten().map(|c| c / STEP_M + ZERO);
    // `as` saturates.
    bytes.extend(coordinates.flat_map(|c| (c.round() as u16).to_le_bytes()));
    bytes.extend(neighbours.iter().map(|(_, category)| category.class()));
    let distances = distances_m.iter().map(|d| (d / STEP_M).round() as u16);
    bytes.extend(distances.flat_map(u16::to_le_bytes));
}

/// Reads a scene from all of `bytes`; `None` where they are not one.
pub(super) fn decode(bytes: &[u8]) -> Option<Scene> {
    let (header, mut rest) = bytes.split_at_checked(HEADER_BYTES)?;
    let category = Category::from_class(header[0])?;
    let [object, neighbours, free, queries, surroundings] =
        [1, 3, 5, 7, 9].map(|at| usize::from(u16::from_le_bytes([header[at], header[at + 1]])));
    let viewpoint =
        [11, 15, 19].map(|at| f32::from_le_bytes([0, 1, 2, 3].map(|byte| header[at + byte])));
    let asked = queries + surroundings;
    if rest.len() != 6 * (object + neighbours + free + 2 * asked) + neighbours + 2 * queries {
        return None;
    }
    let mut take = |count: usize| {
        let (taken, left) = rest.split_at(count);
        rest = left;
        taken
    };
    let object = points(take(6 * object));
    let neighbour_points = points(take(6 * neighbours));
    let free = points(take(6 * free));
    let query_points = points(take(6 * queries));
    let surroundings = points(take(6 * surroundings));
    let nearest = points(take(6 * asked));
    let neighbours = neighbour_points
        .into_iter()
        .zip(take(neighbours))
        .map(|(point, class)| Some((point, Category::from_class(*class)?)))
        .collect::<Option<_>>()?;
    let (distances, _) = take(2 * queries).as_chunks::<2>();
    let distances_m = distances
        .iter()
        .map(|code| f32::from(u16::from_le_bytes(*code)) * STEP_M)
        .collect();
    Some(Scene {
        category,
        object,
        neighbours,
        free,
        viewpoint,
        queries: query_points,
        distances_m,
        surroundings,
        nearest,
    })
}

fn points(bytes: &[u8]) -> Vec<[f32; 3]> {
    let (points, _) = bytes.as_chunks::<6>();
    let coordinate = |a, b| (f32::from(u16::from_le_bytes([a, b])) - ZERO) * STEP_M;
    points
        .iter()
        .map(|&[a, b, c, d, e, f]| [coordinate(a, b), coordinate(c, d), coordinate(e, f)])
        .collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn points(count: usize) -> impl Strategy<Value = Vec<[f32; 3]>> {
        proptest::collection::vec(proptest::array::uniform3(-1.6_f32..1.6), 0..count)
    }

    fn scene() -> impl Strategy<Value = Scene> {
        let class = 1_u8..=6;
        (
            class.clone(),
            points(9),
            points(9),
            points(9),
            points(9),
            points(9),
            class,
        )
            .prop_map(
                |(class, object, neighbours, free, queries, surroundings, other)| {
                    let category = |class| Category::from_class(class).unwrap();
                    Scene {
                        category: category(class),
                        neighbours: neighbours
                            .into_iter()
                            .map(|p| (p, category(other)))
                            .collect(),
                        viewpoint: object.first().copied().unwrap_or_default(),
                        distances_m: queries.iter().map(|[x, _, _]| x.abs()).collect(),
                        nearest: queries
                            .iter()
                            .chain(&surroundings)
                            .map(|[x, y, _]| [*y, *x, 0.1])
                            .collect(),
                        object,
                        free,
                        queries,
                        surroundings,
                    }
                },
            )
    }

    proptest! {
        #[test]
        fn a_scene_comes_back_to_a_fortieth_of_a_millimetre(scene in scene()) {
            let mut bytes = Vec::new();
            encode(&scene, &mut bytes);
            let back = decode(&bytes).unwrap();
            prop_assert_eq!(back.category, scene.category);
            prop_assert_eq!(back.viewpoint, scene.viewpoint);
            let close = |a: &[[f32; 3]], b: &[[f32; 3]]| {
                a.len() == b.len()
                    && a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < 2.6e-5)
            };
            prop_assert!(close(&back.object, &scene.object));
            prop_assert!(close(&back.free, &scene.free));
            prop_assert!(close(&back.queries, &scene.queries));
            prop_assert!(close(&back.surroundings, &scene.surroundings));
            prop_assert!(close(&back.nearest, &scene.nearest));
            for (back, scene) in back.neighbours.iter().zip(&scene.neighbours) {
                prop_assert!(close(&[back.0], &[scene.0]) && back.1 == scene.1);
            }
            prop_assert_eq!(back.neighbours.len(), scene.neighbours.len());
            for (back, scene) in back.distances_m.iter().zip(&scene.distances_m) {
                prop_assert!((back - scene).abs() < 2.6e-5);
            }
            // What was rounded once stays.
            let mut again = Vec::new();
            encode(&back, &mut again);
            prop_assert_eq!(again, &bytes[..]);
            for length in 0..bytes.len() {
                prop_assert!(decode(&bytes[..length]).is_none());
            }
        }

        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            if let Some(scene) = decode(&bytes) {
                prop_assert_eq!(scene.queries.len(), scene.distances_m.len());
                prop_assert_eq!(scene.queries.len() + scene.surroundings.len(), scene.nearest.len());
            }
        }
    }
}
