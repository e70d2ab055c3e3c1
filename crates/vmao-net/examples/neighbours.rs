//! Times farthest-point sampling and neighbour searches; driven by `benches/peers/neighbours.py`.
//!
//! `neighbours REPEATS < REQUEST`: REQUEST is `{"points", "queries", "radius", "nearest", "samples"}`; prints CPU seconds of one
//! repetition and the answers of each search, on one thread.

#![expect(clippy::print_stdout, reason = "an example prints its measurement")]

use serde_json::{Value, json};
use std::error::Error;
use vmao_net::neighbours::{ball_query, farthest_point_order, nearest};

/// Rows of a ball in the request's answers.
const BALL: usize = 16;

fn main() -> Result<(), Box<dyn Error>> {
    let repeats: usize = std::env::args().nth(1).ok_or("usage: neighbours REPEATS")?.parse()?;
    let request: Value = serde_json::from_reader(std::io::stdin())?;
    let points: Vec<[f32; 3]> = serde_json::from_value(request["points"].clone())?;
    let queries: Vec<[f32; 3]> = serde_json::from_value(request["queries"].clone())?;
    let size = |name: &str| request[name].as_u64().map(|n| n as usize).ok_or_else(|| format!("`{name}` is no size"));
    let (count, samples) = (size("nearest")?, size("samples")?);
    let radius = request["radius"].as_f64().ok_or("`radius` is no length")? as f32;
    let weights = vec![1.0; points.len()];
    // One thread, on which the searches then stay.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build()?;
    let answer = pool.install(|| -> Result<Value, Box<dyn Error + Send + Sync>> {
        let order = measured(repeats, || farthest_point_order(&points, &weights, samples))?;
        let near = measured(repeats, || nearest(&points, &queries, count))?;
        let ball = measured(repeats, || ball_query(&points, &queries, radius, BALL))?;
        let told = |(seconds, rows): (f64, Vec<u32>)| json!({"seconds": seconds, "rows": rows});
        Ok(json!({"farthest": told(order), "nearest": told(near), "ball": told(ball)}))
    });
    println!("{}", answer.map_err(|error| error.to_string())?);
    Ok(())
}

fn measured(repeats: usize, work: impl Fn() -> Vec<u32>) -> Result<(f64, Vec<u32>), Box<dyn Error + Send + Sync>> {
    let (mut rows, start) = (Vec::new(), cpu_seconds()?);
    for _ in 0..repeats {
        rows = work();
    }
    Ok(((cpu_seconds()? - start) / repeats as f64, rows))
}

/// CPU time of this thread so far as the kernel's scheduler counts it (s); only Linux tells.
fn cpu_seconds() -> Result<f64, Box<dyn Error + Send + Sync>> {
    std::thread::yield_now(); // the count is brought up to date when the scheduler is called
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    Ok(text.split(' ').next().ok_or("an empty schedstat")?.parse::<f64>()? * 1e-9)
}
