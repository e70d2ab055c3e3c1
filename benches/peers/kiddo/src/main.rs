//! The peer of `benches/peers/neighbours.py`: neighbours by kiddo's immutable k-d tree, one thread, build and queries timed together.
//!
//! `kiddo-peer REPEATS < REQUEST`: REQUEST is `{"points", "queries", "radius", "nearest"}`, the answer `{"nearest": {"seconds", "rows"}, "ball": …}` with
//! all points of a ball in ascending order.

use kiddo::{ImmutableKdTree, SquaredEuclidean};
use serde_json::{Value, json};
use std::error::Error;
use std::num::NonZero;

type Point = [f32; 3];

fn main() -> Result<(), Box<dyn Error>> {
    let repeats: usize = std::env::args().nth(1).ok_or("usage: kiddo-peer REPEATS")?.parse()?;
    let request: Value = serde_json::from_reader(std::io::stdin())?;
    let points: Vec<Point> = serde_json::from_value(request["points"].clone())?;
    let queries: Vec<Point> = serde_json::from_value(request["queries"].clone())?;
    let count = NonZero::new(request["nearest"].as_u64().ok_or("nearest")? as usize).ok_or("nearest is zero")?;
    let radius = request["radius"].as_f64().ok_or("radius")? as f32;
    let nearest = measured(repeats, &points, &queries, |tree, query| {
        let found = tree.query(query).nearest_n::<SquaredEuclidean<f32>>(count).execute();
        found.iter().map(|near| near.item as u32).collect()
    })?;
    let mut ball = measured(repeats, &points, &queries, |tree, query| {
        let found = tree.query(query).within::<SquaredEuclidean<f32>>(radius * radius).unsorted().execute();
        found.iter().map(|near| near.item as u32).collect()
    })?;
    ball.1.iter_mut().for_each(|row| row.sort_unstable());
    let told = |(seconds, rows): (f64, Vec<Vec<u32>>)| json!({"seconds": seconds, "rows": rows});
    println!("{}", json!({"nearest": told(nearest), "ball": told(ball)}));
    Ok(())
}

/// CPU seconds of one repetition, the tree built in each, and the answers.
fn measured(
    repeats: usize,
    points: &[Point],
    queries: &[Point],
    answer: impl Fn(&ImmutableKdTree<f32, 3>, &Point) -> Vec<u32>,
) -> Result<(f64, Vec<Vec<u32>>), Box<dyn Error>> {
    let (mut rows, start) = (Vec::new(), cpu_seconds()?);
    for _ in 0..repeats {
        let tree = ImmutableKdTree::<f32, 3>::new_from_slice(points).map_err(|error| format!("{error:?}"))?;
        rows = queries.iter().map(|query| answer(&tree, query)).collect();
    }
    Ok(((cpu_seconds()? - start) / repeats as f64, rows))
}

fn cpu_seconds() -> Result<f64, Box<dyn Error>> {
    std::thread::yield_now(); // the count is brought up to date when the scheduler is called
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    Ok(text.split(' ').next().ok_or("an empty schedstat")?.parse::<f64>()? * 1e-9)
}
