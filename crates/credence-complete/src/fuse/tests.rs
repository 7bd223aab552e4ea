use proptest::prelude::*;

use super::*;

/// Points along x, millimetres, each with its spread.
fn row(points_mm: &[(f64, f64)]) -> SpreadCloud {
    SpreadCloud {
        points_world: points_mm
            .iter()
            .map(|(x, _)| Point::new(x / 1e3, 0.0, 0.0))
            .collect(),
        spread_m: points_mm.iter().map(|(_, spread)| spread / 1e3).collect(),
    }
}

/// Where the fused points lie, sorted, millimetres.
fn fused_mm(views: &[SpreadCloud], seen: &SeenSpace<'_>, count: usize) -> Vec<f64> {
    let fused = fuse(views, seen, count).unwrap();
    let mut places: Vec<f64> = fused
        .points_world
        .iter()
        .map(|p| (p.x * 1e3).round())
        .collect();
    places.sort_by(f64::total_cmp);
    places
}

const UNSEEN: SeenSpace<'_> = SeenSpace {
    is_free: &|_| false,
    observed_world: &[],
    near_m: 0.005,
};

#[test]
fn a_guess_on_a_surer_surface_says_nothing() {
    // Of the second view, the guess at 3 may lie on the sure point at 0, that at 9 may not,
    // that at 20 is as sure as its neighbour, and the one at 41 has only its own view beside it.
    let sure = row(&[(0.0, 0.5), (21.0, 1.0)]);
    let guesses = row(&[
        (3.0, 1.0),
        (9.0, 2.0),
        (20.0, 1.2),
        (40.0, 0.5),
        (41.0, 2.0),
    ]);
    assert_eq!(
        fused_mm(&[sure, guesses], &UNSEEN, 99),
        [0.0, 9.0, 20.0, 21.0, 40.0, 41.0]
    );
}

#[test]
fn no_spread_reaches_farther_than_a_centimetre() {
    let sure = row(&[(0.0, 1.0)]);
    let lost = row(&[(9.0, 50.0), (11.0, 50.0)]);
    assert_eq!(fused_mm(&[sure, lost], &UNSEEN, 99), [0.0, 11.0]);
}

#[test]
fn an_unsure_guess_that_no_other_view_shares_goes_unless_it_was_measured() {
    // Of the first view, 10 apart, only the guess at 50 is less sure than 1.5 medians; the
    // second view's nearest point is at 20.
    let first = [
        (0.0, 1.0),
        (10.0, 1.0),
        (20.0, 1.0),
        (50.0, 1.6),
        (40.0, 1.4),
    ];
    let second = [(0.0, 1.0), (10.0, 1.0), (20.0, 1.0)];
    let views = [row(&first), row(&second)];
    let fused = fused_mm(&views, &UNSEEN, 99);
    assert_eq!(fused, [0.0, 0.0, 10.0, 10.0, 20.0, 20.0, 40.0]);
    let measured = [Point::new(0.053, 0.0, 0.0)];
    let seen = SeenSpace {
        observed_world: &measured,
        ..UNSEEN
    };
    assert_eq!(fused_mm(&views, &seen, 99).last(), Some(&50.0));
    // A view whose points are 12 apart shares what is 12 away from one of them.
    let wide = [row(&first), row(&[(26.0, 1.0), (38.0, 1.0)])];
    assert!(fused_mm(&wide, &UNSEEN, 99).contains(&50.0));
    // That some of them are there twice brings them no nearer.
    let twice = row(&[(26.0, 1.0), (26.0, 1.0), (38.0, 1.0), (38.0, 1.0)]);
    let wide = [row(&first), twice];
    assert!(fused_mm(&wide, &UNSEEN, 99).contains(&50.0));
}

#[test]
fn what_was_looked_through_goes_unless_it_was_measured() {
    let views = [row(&[(0.0, 1.0), (30.0, 1.0)]), row(&[(60.0, 1.0)])];
    let measured = [0.0, 0.064].map(|x| Point::new(x, 0.0, 0.0));
    let seen = SeenSpace {
        is_free: &|p| p.x > 0.02,
        observed_world: &measured,
        near_m: 0.005,
    };
    assert_eq!(fused_mm(&views, &seen, 99), [0.0, 60.0]);
}

/// A square of 10 x 10 points, 5 mm apart, at a height in millimetres.
fn sheet(z: f64) -> SpreadCloud {
    let at = |i: usize| 0.005 * (i % 10) as f64;
    let points = (0..100).map(|i| Point::new(at(i), at(i / 10), z / 1e3));
    SpreadCloud {
        points_world: points.collect(),
        spread_m: vec![0.001; 100],
    }
}

#[test]
fn a_view_that_misses_what_was_measured_is_left_out() {
    let measured = sheet(0.0).points_world;
    let seen = SeenSpace {
        observed_world: &measured,
        ..UNSEEN
    };
    let [near, off, far] = [1.0, 1.3, 1.5].map(sheet);
    let both = fuse(&[near.clone(), off.clone(), far.clone()], &seen, 999).unwrap();
    assert_eq!(both.points_world.len(), 200);
    assert!(both.points_world.iter().all(|p| p.z < 0.0014));
    let alone = fuse(&[near.clone(), far], &seen, 999).unwrap();
    assert_eq!(alone.points_world.len(), 100);
    assert!(alone.points_world.iter().all(|p| p.z == 0.001));
    // Without measurements all are equal.
    let all = fuse(&[near, off, sheet(9.0)], &UNSEEN, 999).unwrap();
    assert_eq!(all.points_world.len(), 300);
}

#[test]
fn views_that_differ_by_less_than_the_noise_all_stay() {
    let measured = sheet(0.0).points_world;
    let seen = SeenSpace {
        observed_world: &measured,
        ..UNSEEN
    };
    // The second's misfit is thirteen times the first's.
    let fused = fuse(&[0.1, 1.3, 1.5].map(sheet), &seen, 999).unwrap();
    assert_eq!(fused.points_world.len(), 200);
}

#[test]
fn the_view_that_is_left_of_several_is_carved() {
    // What was measured lies below the first three columns of a sheet, whose spread is 1 mm but
    // for a point of the fourth; what lies beyond 2 cm was looked through.
    let mut near = sheet(1.0);
    near.spread_m[3] = 0.005;
    let measured: Vec<Point> = sheet(0.0).points_world;
    let measured: Vec<Point> = measured.into_iter().filter(|p| p.x < 0.011).collect();
    let seen = SeenSpace {
        is_free: &|p| p.x > 0.02,
        observed_world: &measured,
        near_m: 0.003,
    };
    let views = [near, sheet(30.0)];
    let fused = fuse(&views, &seen, 999).unwrap();
    assert!(
        fused
            .points_world
            .iter()
            .all(|p| p.z == 0.001 && p.x <= 0.02)
    );
    // Columns at 0, 5, 10, 15 and 20 mm, and the unsure point among them: no view is left to
    // share it.
    assert_eq!(fused.points_world.len(), 50);
    assert!(fused.spread_m.contains(&0.005));
}

#[test]
fn thinning_keeps_the_surest() {
    let first = row(&[(0.0, 1.0), (8.5, 2.0), (20.0, 1.0)]);
    let second = row(&[(2.0, 1.5), (11.0, 1.5), (22.0, 1.5)]);
    assert_eq!(fused_mm(&[first, second], &UNSEEN, 3), [0.0, 11.0, 20.0]);
}

#[test]
fn one_view_is_left_alone() {
    let view = row(&[(5.0, 1.0), (5.0, 9.0), (7.0, 2.0)]);
    let free = SeenSpace {
        is_free: &|_| true,
        ..UNSEEN
    };
    assert_eq!(fuse(std::slice::from_ref(&view), &free, 2).unwrap(), view);
    assert_eq!(fuse(&[], &UNSEEN, 5).unwrap(), SpreadCloud::default());
    assert_eq!(
        fuse(&[view, row(&[])], &free, 5).unwrap(),
        SpreadCloud::default()
    );
}

proptest! {
    #[test]
    fn fused_points_are_the_views_own_and_no_more_than_asked(
        views in prop::collection::vec(
            prop::collection::vec(([-0.05..0.05_f64, -0.05..0.05, -0.05..0.05], 0.0..0.02_f64), 0..80),
            2..4,
        ),
        count in 0..150_usize,
    ) {
        let clouds: Vec<SpreadCloud> = views.iter().map(|view| SpreadCloud {
            points_world: view.iter().map(|(p, _)| Point::from(*p)).collect(),
            spread_m: view.iter().map(|(_, s)| *s).collect(),
        }).collect();
        let fused = fuse(&clouds, &UNSEEN, count).unwrap();
        prop_assert!(fused.points_world.len() <= count);
        prop_assert_eq!(fused.points_world.len(), fused.spread_m.len());
        for (point, spread) in fused.points_world.iter().zip(&fused.spread_m) {
            let is_own = views.iter().flatten().any(|(p, s)| Point::from(*p) == *point && s == spread);
            prop_assert!(is_own);
        }
        // The surest guess of all is never explained and never thinned out.
        let surest = views.iter().flatten().map(|(_, s)| *s).fold(f64::INFINITY, f64::min);
        if count >= views.iter().map(Vec::len).sum::<usize>() && surest.is_finite() {
            prop_assert!(fused.spread_m.contains(&surest));
        }
    }
}
