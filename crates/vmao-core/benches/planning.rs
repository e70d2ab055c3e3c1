//! Time of plans, of checks of one configuration and of a whole edge, on the planning problem sets.

use criterion::{Criterion, criterion_group, criterion_main};
use std::hint::black_box;
use vmao_core::{
    collision::CollisionChecker,
    planning::{PlanSettings, plan},
    planning_problems::{Family, PlanningProblem},
    random::Stream,
    robots::panda,
};

/// The first eight problems of a set, one after the other.
fn plans(criterion: &mut Criterion) {
    for (family, name, arms) in [
        (Family::Shelf, "shelf", 1),
        (Family::Shelf, "shelf", 2),
        (Family::Crossed, "crossed", 1),
        (Family::Crossed, "crossed", 2),
        (Family::Crossed, "crossed", 3),
    ] {
        let problems: Vec<PlanningProblem> =
            (0..8).map(|index| PlanningProblem::new(family, &vec![panda(); arms], index)).collect();
        criterion.bench_function(&format!("8 plans, {name}, {arms} arms"), |bencher| {
            bencher.iter(|| {
                for problem in &problems {
                    let mut stream = Stream::new(0, &[]);
                    black_box(plan(&problem.world(), &problem.start, &problem.goal, &PlanSettings::default(), &mut stream));
                }
            });
        });
    }
}

fn checks(criterion: &mut Criterion) {
    for arms in 1..=3 {
        let problem = PlanningProblem::new(Family::Crossed, &vec![panda(); arms], 0);
        let world = problem.world();
        let mut checker = CollisionChecker::new(&world);
        let ends = [&problem.witness[0], &problem.witness[1]];
        let mut turn = 0;
        criterion.bench_function(&format!("configuration, {arms} arms"), |bencher| {
            bencher.iter(|| {
                turn = 1 - turn;
                checker.is_free(black_box(ends[turn]), 0.005)
            });
        });
        criterion.bench_function(&format!("edge, {arms} arms"), |bencher| {
            bencher.iter(|| checker.edge_is_free(black_box(ends[0]), black_box(ends[1]), 0.005));
        });
    }
}

criterion_group!(benches, plans, checks);
criterion_main!(benches);
