use burn::tensor::{Device, Int, Tensor, TensorData};

use super::{
    SUBSET_FREE, SUBSET_OBJECT, Support,
    support::{NEAR_FREE, NEAR_OBJECT, Near, within_reach},
};
use crate::NnError;

/// Frequencies of the positional features, radians per unit.
const FREQUENCIES: [f32; 3] = [3.0, 6.0, 12.0];

/// Features of a query that need no neighbours' codes: place, distances, sines and cosines.
pub(super) const PLACE: usize = 3 + 2 + 2 * 3 * FREQUENCIES.len();

/// Numbers that describe an edge from a query to a neighbour: offset and distance.
pub(super) const EDGE: usize = 4;

/// Units of an edge's numbers per unit of the frame: neighbours are millimetres away.
const EDGE_SCALE: f32 = 10.0;

/// The host's half of an embedding: what the network needs of one observation's queries.
///
/// Preparing it is a neighbour search; it touches no tensor and may run on any thread.
#[derive(Debug, Clone)]
pub struct Sample {
    points: Vec<[f32; 4]>,
    object_subset: Vec<usize>,
    free_subset: Vec<usize>,
    queries: Queries,
}

#[derive(Debug, Clone)]
struct Queries {
    object_edges: Vec<[f32; EDGE]>,
    object_rows: Vec<usize>,
    free_edges: Vec<[f32; EDGE]>,
    free_rows: Vec<usize>,
    places: Vec<[f32; PLACE]>,
}

impl Sample {
    /// Prepares the queries, points in the object's frame.
    ///
    /// # Errors
    /// A query that is not finite.
    pub fn new(support: &Support, queries: &[[f32; 3]]) -> Result<Self, NnError> {
        Ok(Self {
            points: support.rows().collect(),
            object_subset: support.object_subset().collect(),
            free_subset: support.free_subset().collect(),
            queries: Queries::new(support, queries)?,
        })
    }
}

impl Queries {
    fn new(support: &Support, queries: &[[f32; 3]]) -> Result<Self, NnError> {
        let queries: Vec<[f32; 3]> = queries.iter().map(|q| within_reach(*q)).collect();
        let [object, free] = support.near(&queries)?;
        let (object_edges, object_rows) = edges(&object, &queries);
        let (free_edges, free_rows) = edges(&free, &queries);
        let distances = |edges: &[[f32; EDGE]], count: usize| -> Vec<f32> {
            edges
                .chunks_exact(count)
                .map(|near| near[0][3] / EDGE_SCALE)
                .collect()
        };
        let to_object = distances(&object_edges, NEAR_OBJECT);
        let to_free = distances(&free_edges, NEAR_FREE);
        let near = to_object.iter().zip(&to_free);
        let places = queries
            .iter()
            .zip(near)
            .map(|(q, (object, free))| place(*q, *object, *free));
        Ok(Self {
            places: places.collect(),
            object_edges,
            object_rows,
            free_edges,
            free_rows,
        })
    }
}

/// Edges from each query to its neighbours, and the neighbours' rows.
fn edges(near: &Near<'_>, queries: &[[f32; 3]]) -> (Vec<[f32; EDGE]>, Vec<usize>) {
    let rows = near.indices.iter().map(|i| near.first_row + *i as usize);
    let neighbours = near.indices.chunks_exact(near.count).zip(queries);
    let numbers = neighbours.flat_map(|(indices, query)| {
        indices.iter().map(|index| {
            let point = near.points[*index as usize];
            let [x, y, z] = [0, 1, 2].map(|axis| (point[axis] - query[axis]) * EDGE_SCALE);
            [x, y, z, (x * x + y * y + z * z).sqrt()]
        })
    });
    (numbers.collect(), rows.collect())
}

fn place(query: [f32; 3], to_object: f32, to_free: f32) -> [f32; PLACE] {
    let mut features = [0.0; PLACE];
    let (plain, waves) = features.split_at_mut(5);
    plain[..3].copy_from_slice(&query);
    plain[3..].copy_from_slice(&[to_object, to_free]);
    for (slots, frequency) in waves.chunks_exact_mut(6).zip(FREQUENCIES) {
        for (axis, coordinate) in query.into_iter().enumerate() {
            let (sin, cos) = (coordinate * frequency).sin_cos();
            slots[axis] = sin;
            slots[3 + axis] = cos;
        }
    }
    features
}

/// The tensors of observations that are embedded together, points and edges laid end to end, so
/// that each observation may have as many support points as it likes.
#[derive(Debug, Clone)]
pub struct Batch {
    pub(super) points: Tensor<2>,
    /// Rows of `points`: every observation's object subset, then every one's free subset.
    pub(super) subset: Tensor<1, Int>,
    pub(super) queries: QueryTensors,
}

/// The tensors of the queries: every observation's object edges, then every one's free edges.
#[derive(Debug, Clone)]
pub struct QueryTensors {
    pub(super) observations: usize,
    /// Queries of each observation.
    pub(super) count: usize,
    pub(super) edges: Tensor<2>,
    pub(super) rows: Tensor<1, Int>,
    pub(super) places: Tensor<2>,
}

impl Batch {
    /// Puts prepared observations on the device.
    ///
    /// # Errors
    /// No observations, or observations with different numbers of queries.
    pub fn new(samples: &[Sample], device: &Device) -> Result<Self, NnError> {
        let first = samples.first().ok_or(NnError::EmptyBatch)?;
        let expected = first.queries.places.len();
        let mut first_rows = Vec::with_capacity(samples.len());
        let mut rows = 0;
        for (index, sample) in samples.iter().enumerate() {
            let found = sample.queries.places.len();
            if found != expected {
                return Err(NnError::RaggedBatch {
                    index,
                    found,
                    expected,
                });
            }
            first_rows.push(rows);
            rows += sample.points.len();
        }
        let points = samples.iter().flat_map(|s| &s.points).flatten().copied();
        let object = shifted(samples, &first_rows, |s| &s.object_subset);
        let free = shifted(samples, &first_rows, |s| &s.free_subset);
        let count = samples.len() * (SUBSET_OBJECT + SUBSET_FREE);
        Ok(Self {
            points: floats(points, [rows, 4], device),
            subset: ints(object.chain(free), count, device),
            queries: QueryTensors::new(
                &samples.iter().map(|s| &s.queries).collect::<Vec<_>>(),
                &first_rows,
                expected,
                device,
            ),
        })
    }
}

impl Batch {
    /// The queries of all observations.
    pub const fn queries(&self) -> &QueryTensors {
        &self.queries
    }
}

impl QueryTensors {
    /// Queries of an observation that is encoded on its own.
    ///
    /// # Errors
    /// A query that is not finite.
    pub fn of(support: &Support, queries: &[[f32; 3]], device: &Device) -> Result<Self, NnError> {
        let prepared = Queries::new(support, queries)?;
        Ok(Self::new(&[&prepared], &[0], queries.len(), device))
    }

    fn new(queries: &[&Queries], first_rows: &[usize], count: usize, device: &Device) -> Self {
        let total = queries.len() * count;
        let object = queries.iter().flat_map(|q| &q.object_edges);
        let edges = object.chain(queries.iter().flat_map(|q| &q.free_edges));
        let object = shifted(queries, first_rows, |q| &q.object_rows);
        let rows = object.chain(shifted(queries, first_rows, |q| &q.free_rows));
        let places = queries.iter().flat_map(|q| &q.places);
        let edge_count = total * (NEAR_OBJECT + NEAR_FREE);
        Self {
            observations: queries.len(),
            count,
            edges: floats(edges.flatten().copied(), [edge_count, EDGE], device),
            rows: ints(rows, edge_count, device),
            places: floats(places.flatten().copied(), [total, PLACE], device),
        }
    }
}

/// Rows of each observation, counted from the batch's first row.
fn shifted<'a, T>(
    observations: &'a [T],
    first_rows: &'a [usize],
    rows: impl Fn(&'a T) -> &'a Vec<usize> + 'a,
) -> impl Iterator<Item = usize> + 'a {
    let shifted = move |(observation, first): (&'a T, &'a usize)| {
        rows(observation).iter().map(move |row| first + row)
    };
    observations.iter().zip(first_rows).flat_map(shifted)
}

fn floats(values: impl Iterator<Item = f32>, shape: [usize; 2], device: &Device) -> Tensor<2> {
    let mut all = Vec::with_capacity(shape[0] * shape[1]);
    all.extend(values);
    Tensor::from_data(TensorData::new(all, shape), device)
}

fn ints(values: impl Iterator<Item = usize>, count: usize, device: &Device) -> Tensor<1, Int> {
    let mut all = Vec::with_capacity(count);
    all.extend(values.map(|v| v.cast_signed() as i64));
    Tensor::from_data(TensorData::new(all, [count]), device)
}
