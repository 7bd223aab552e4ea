use parry3d_f64::{math::Vector, query::PointQuery as _, shape::Triangle};

use super::bounds::OrientedBox;

/// Faces that a leaf holds at most: fewer cost more boxes, more cost more projections.
const LEAF_FACES: usize = 4;

/// Levels that the tree can have: the median splits halve the faces, whose indices are 32 bit.
const MAX_DEPTH: usize = 32;

/// Finds the face nearest to a point.
///
/// 1. Faces are split at the median along the longest axis of their [`OrientedBox`], down to
///    [`LEAF_FACES`].
/// 2. A query descends into the nearer child first and keeps the other with its bound.
/// 3. A box whose bound is not below the best distance so far is dropped, when it is met and again
///    when it is taken up.
///
/// parry's own tree of axis-aligned boxes was tried first. On bumpy tori and queries up to 3 cm
/// away its cost per query grows 15-fold from 500 to 128,000 faces (as sqrt(faces)), this one's
/// 4-fold; they break even at about 8,000 faces.
#[derive(Debug)]
pub(super) struct FaceTree {
    nodes: Vec<[Child; 2]>,
    faces: Vec<Triangle>,
}

#[derive(Debug, Clone, Copy)]
struct Child {
    bounds: OrientedBox,
    content: Content,
}

#[derive(Debug, Clone, Copy)]
enum Content {
    Node(u32),
    Faces { start: u32, count: u32 },
}

impl FaceTree {
    /// A tree over faces with area. `scale` is the largest coordinate of the mesh.
    pub(super) fn new(mut faces: Vec<Triangle>, scale: f64) -> Self {
        let mut nodes = Vec::with_capacity(faces.len() / 2);
        if faces.len() > LEAF_FACES {
            let bounds = OrientedBox::fit(&faces, scale);
            build(&mut nodes, &mut faces, 0, &bounds, scale);
        }
        Self { nodes, faces }
    }

    /// All faces, in the tree's order.
    pub(super) fn faces(&self) -> &[Triangle] {
        &self.faces
    }

    /// The squared distance to the nearest face.
    pub(super) fn squared_distance(&self, point: Vector) -> f64 {
        let mut best = f64::INFINITY;
        if self.nodes.is_empty() {
            return nearest_of(&self.faces, point, best);
        }
        let mut waiting = [(0.0, 0_u32); MAX_DEPTH];
        let mut waiting_len = 0;
        let mut node = 0;
        loop {
            let [left, right] = &self.nodes[node as usize];
            let mut near = (left.bounds.squared_distance(point), left);
            let mut far = (right.bounds.squared_distance(point), right);
            if far.0 < near.0 {
                (near, far) = (far, near);
            }
            let mut next = None;
            for (bound, child) in [near, far] {
                if bound >= best {
                    continue;
                }
                match child.content {
                    Content::Faces { start, count } => {
                        let range = start as usize..(start + count) as usize;
                        best = nearest_of(&self.faces[range], point, best);
                    }
                    Content::Node(index) if next.is_none() => next = Some(index),
                    Content::Node(index) => {
                        waiting[waiting_len] = (bound, index);
                        waiting_len += 1;
                    }
                }
            }
            while next.is_none() {
                if waiting_len == 0 {
                    return best;
                }
                waiting_len -= 1;
                let (bound, index) = waiting[waiting_len];
                next = (bound < best).then_some(index);
            }
            node = next.unwrap_or_default();
        }
    }
}

/// Appends the subtree of `faces`, which start at `offset` of the whole list; returns its index.
fn build(
    nodes: &mut Vec<[Child; 2]>,
    faces: &mut [Triangle],
    offset: usize,
    bounds: &OrientedBox,
    scale: f64,
) -> u32 {
    let axis = bounds.long_axis();
    let middle = faces.len() / 2;
    let key = |face: &Triangle| axis.dot(face.a + face.b + face.c);
    faces.select_nth_unstable_by(middle, |a, b| key(a).total_cmp(&key(b)));
    let (left, right) = faces.split_at_mut(middle);
    let child = |part: &[Triangle], start: usize| Child {
        bounds: OrientedBox::fit(part, scale),
        content: Content::Faces {
            start: start as u32,
            count: part.len() as u32,
        },
    };
    let children = [child(left, offset), child(right, offset + middle)];
    let index = nodes.len();
    nodes.push(children);
    for (side, (part, start)) in [(left, offset), (right, offset + middle)]
        .into_iter()
        .enumerate()
    {
        if part.len() > LEAF_FACES {
            let below = build(nodes, part, start, &children[side].bounds, scale);
            nodes[index][side].content = Content::Node(below);
        }
    }
    index as u32
}

/// The squared distance to the nearest of a few faces, or `limit` where none is nearer.
#[inline]
fn nearest_of(faces: &[Triangle], point: Vector, limit: f64) -> f64 {
    faces.iter().fold(limit, |best, face| {
        best.min(squared_distance_to_face(face, point))
    })
}

/// The squared distance from a point to its projection onto a face.
#[inline]
pub(super) fn squared_distance_to_face(face: &Triangle, point: Vector) -> f64 {
    (face.project_local_point(point, false).point - point).length_squared()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed wavy tube of 2,000 faces, where many faces are almost equally near.
    fn tube() -> Vec<Triangle> {
        let corner = |ring: u32, side: u32| {
            let a = f64::from(ring % 50) / 50.0 * std::f64::consts::TAU;
            let b = f64::from(side % 20) / 20.0 * std::f64::consts::TAU;
            let tube = 0.3 + 0.05 * (5.0 * a).sin() * (3.0 * b).cos();
            let radius = 1.0 + tube * b.cos();
            Vector::new(radius * a.cos(), radius * a.sin(), tube * b.sin())
        };
        let squares = (0..50).flat_map(|ring| (0..20).map(move |side| (ring, side)));
        squares
            .flat_map(|(r, s)| {
                let [a, b] = [corner(r, s), corner(r + 1, s + 1)];
                [
                    Triangle::new(a, corner(r + 1, s), b),
                    Triangle::new(a, b, corner(r, s + 1)),
                ]
            })
            .collect()
    }

    #[test]
    fn finds_what_a_scan_of_all_faces_finds_bit_for_bit() {
        let faces = tube();
        let tree = FaceTree::new(faces.clone(), 1.4);
        for i in 0..1000 {
            let angle = f64::from(i);
            let point = Vector::new(
                2.0 * (1.3 * angle).sin(),
                2.0 * (1.7 * angle).cos(),
                (2.3 * angle).sin(),
            );
            let scanned = nearest_of(&faces, point, f64::INFINITY);
            assert_eq!(tree.squared_distance(point), scanned);
        }
    }

    #[test]
    fn keeps_every_face_and_halves_them_level_by_level() {
        for count in [1, 4, 5, 9, 100] {
            let faces: Vec<Triangle> = tube().into_iter().take(count).collect();
            let tree = FaceTree::new(faces, 1.4);
            assert_eq!(tree.faces().len(), count);
            let in_leaves: usize = tree
                .nodes
                .iter()
                .flatten()
                .filter_map(|child| match child.content {
                    Content::Faces { count, .. } => Some(count as usize),
                    Content::Node(_) => None,
                })
                .sum();
            assert_eq!(in_leaves, if count > LEAF_FACES { count } else { 0 });
        }
    }
}
