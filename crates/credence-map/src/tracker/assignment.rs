/// One-to-one assignment of rows to columns with the least total cost, where leaving a row
/// unassigned costs `gate` and pairs dearer than `gate` are not allowed.
///
/// Hungarian method with potentials (Kuhn 1955, Munkres 1957; shortest augmenting paths as in
/// Jonker & Volgenant 1987), O(n^3). Every row gets a spare column at the price of the gate.
pub(super) fn assign(costs: &[Vec<f64>], columns: usize, gate: f64) -> Vec<Option<usize>> {
    let rows = costs.len();
    let width = columns + rows;
    // Dearer than leaving all rows unassigned, yet finite, so that differences stay numbers.
    let forbidden = gate * (rows + 1) as f64;
    let cost = |row: usize, column: usize| match costs[row].get(column) {
        None => gate,
        Some(&cost) if cost <= gate => cost,
        Some(_) => forbidden,
    };
    // Index 0 stands for "none"; rows and columns count from 1.
    let mut row_potential = vec![0.0; rows + 1];
    let mut column_potential = vec![0.0; width + 1];
    let mut row_of = vec![0; width + 1];
    for row in 1..=rows {
        row_of[0] = row;
        let mut slack = vec![f64::INFINITY; width + 1];
        let mut from = vec![0; width + 1];
        let mut visited = vec![false; width + 1];
        let mut column = 0;
        while row_of[column] != 0 {
            visited[column] = true;
            let current = row_of[column];
            let mut step = f64::INFINITY;
            let mut nearest = 0;
            for next in 1..=width {
                if visited[next] {
                    continue;
                }
                let reduced =
                    cost(current - 1, next - 1) - row_potential[current] - column_potential[next];
                if reduced < slack[next] {
                    slack[next] = reduced;
                    from[next] = column;
                }
                if slack[next] < step {
                    step = slack[next];
                    nearest = next;
                }
            }
            for j in 0..=width {
                if visited[j] {
                    row_potential[row_of[j]] += step;
                    column_potential[j] -= step;
                } else {
                    slack[j] -= step;
                }
            }
            column = nearest;
        }
        while column != 0 {
            row_of[column] = row_of[from[column]];
            column = from[column];
        }
    }
    let mut assigned = vec![None; rows];
    for column in 0..columns {
        if let Some(row) = row_of[column + 1].checked_sub(1)
            && costs[row][column] <= gate
        {
            assigned[row] = Some(column);
        }
    }
    assigned
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Total cost of an assignment; `None` if a pair is beyond the gate or a column taken twice.
    fn total(costs: &[Vec<f64>], assigned: &[Option<usize>], gate: f64) -> Option<f64> {
        let mut taken = std::collections::BTreeSet::new();
        let mut sum = 0.0;
        for (row, column) in costs.iter().zip(assigned) {
            sum += match column {
                None => gate,
                Some(c) if row[*c] <= gate && taken.insert(*c) => row[*c],
                Some(_) => return None,
            };
        }
        Some(sum)
    }

    /// The least cost over all assignments, tried one by one.
    fn least(costs: &[Vec<f64>], columns: usize, gate: f64) -> f64 {
        let choices = columns + 1;
        (0..choices.pow(costs.len() as u32))
            .filter_map(|mut code| {
                let assigned: Vec<Option<usize>> = costs
                    .iter()
                    .map(|_| {
                        let column = code % choices;
                        code /= choices;
                        (column < columns).then_some(column)
                    })
                    .collect();
                total(costs, &assigned, gate)
            })
            .fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_whole_beats_the_greedy_choice() {
        // Greedy takes (0, 0) at 1 and leaves row 1 with 9; together 2 + 2 is less.
        let costs = [vec![1.0, 2.0], vec![2.0, 9.0]];
        assert_eq!(assign(&costs, 2, 10.0), [Some(1), Some(0)]);
        // Row 1 is beyond the gate: better alone than far.
        assert_eq!(assign(&[vec![1.0], vec![7.0]], 1, 5.0), [Some(0), None]);
        assert_eq!(assign(&[], 3, 5.0), []);
        assert_eq!(assign(&[vec![], vec![]], 0, 5.0), [None, None]);
    }

    proptest! {
        #[test]
        fn no_assignment_is_cheaper(
            (columns, costs) in (0_usize..4).prop_flat_map(|columns| {
                let row = prop::collection::vec(0.0..3.0, columns);
                (Just(columns), prop::collection::vec(row, 0..5))
            }),
            gate in 0.1..3.0,
        ) {
            let assigned = assign(&costs, columns, gate);
            let cost = total(&costs, &assigned, gate);
            prop_assert!(cost.is_some(), "{assigned:?}");
            prop_assert!((cost.unwrap() - least(&costs, columns, gate)).abs() < 1e-9);
        }
    }
}
