//! Times training steps and sampled maps of one network; driven by `benches/peers/network.py`.
//!
//! `network_step DIR CLOUDS THREADS STEPS export|step|search|map [cpu|cuda]`: DIR holds `network.json`. `export` writes the batch as
//! DIR/batch.safetensors, a network after three steps as DIR/warmed.safetensors and its map as DIR/map.json; the others print CPU
//! seconds and wall seconds of each of STEPS repetitions, losses, and peak memory.

#![expect(clippy::print_stdout, reason = "an example prints its measurement")]
#![expect(clippy::unwrap_used, reason = "the module of scenes is that of the tests")]

#[path = "../tests/bar_world/mod.rs"]
mod bar_world;

use bar_world::denser_scene;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::time::Instant;
use vmao_net::{ContactNetwork, Device, Example, ModelKind, NetworkConfig, Rehearsal};

/// Points of one scene of the bar world.
const SCENE: usize = 1020;
const LEARNING_RATE: f32 = 1e-3;
const SEED: u64 = 0;
/// Every number of the latent code of sampled maps.
const LATENT: f32 = 0.5;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, folder, clouds, threads, steps, what, rest @ ..] = arguments.as_slice() else {
        return Err("usage: network_step DIR CLOUDS THREADS STEPS export|step|search|map [cpu|cuda]".into());
    };
    let device = match rest {
        [] => Device::Cpu,
        [name] if name == "cpu" => Device::Cpu,
        [name] if name == "cuda" => Device::cuda()?,
        _ => return Err(format!("{rest:?}: expected cpu, cuda or nothing").into()),
    };
    rayon::ThreadPoolBuilder::new().num_threads(threads.parse()?).build_global()?;
    let folder = Path::new(folder);
    let network: NetworkConfig = serde_json::from_slice(&fs::read(folder.join("network.json"))?)?;
    let examples: Vec<Example> = (0..clouds.parse()?).map(|i| cloud(i, network.points)).collect();
    let steps: usize = steps.parse()?;
    match what.as_str() {
        "export" => export(folder, &network, &examples),
        "step" | "search" => train(&network, examples, steps, what == "search", device),
        "map" => sample(&network, &examples, steps),
        _ => Err(format!("{what}: expected export, step, search or map").into()),
    }
}

fn cloud(index: u64, points: usize) -> Example {
    let mut example = denser_scene(1, index, points.div_ceil(SCENE)).example;
    // The scene lists its parts one after the other: keep every part's share.
    let kept = |list: &[[f32; 3]]| (0..points).map(|i| list[i * list.len() / points]).collect();
    (example.points, example.colors) = (kept(&example.points), kept(&example.colors));
    example
}

/// A network whose running statistics have met the batch, so that maps are not flat.
fn warmed(network: &NetworkConfig, examples: &[Example]) -> Result<Rehearsal, Box<dyn Error>> {
    let mut rehearsal = Rehearsal::new(ModelKind::Vmao, network, examples.to_vec(), SEED, Device::Cpu)?;
    for _ in 0..3 {
        rehearsal.step(LEARNING_RATE)?;
    }
    Ok(rehearsal)
}

fn export(folder: &Path, network: &NetworkConfig, examples: &[Example]) -> Result<(), Box<dyn Error>> {
    let rehearsal = Rehearsal::new(ModelKind::Vmao, network, examples.to_vec(), SEED, Device::Cpu)?;
    fs::write(folder.join("batch.safetensors"), rehearsal.to_safetensors()?)?;
    let warmed = warmed(network, examples)?;
    fs::write(folder.join("warmed.safetensors"), warmed.checkpoint().to_safetensors()?)?;
    let contacts = ContactNetwork::load(&warmed.checkpoint());
    let map = contacts.map(&examples[0].points, &examples[0].colors, &vec![LATENT; network.latent_size])?;
    fs::write(folder.join("map.json"), serde_json::to_vec(&map.fingers)?)?;
    Ok(())
}

fn train(
    network: &NetworkConfig,
    examples: Vec<Example>,
    steps: usize,
    search: bool,
    device: Device,
) -> Result<(), Box<dyn Error>> {
    let mut rehearsal = Rehearsal::new(ModelKind::Vmao, network, examples, SEED, device)?;
    let mut losses = vec![rehearsal.step(LEARNING_RATE)?];
    let times = timed(steps, || {
        if search {
            rehearsal.search();
        }
        losses.push(rehearsal.step(LEARNING_RATE)?);
        Ok(())
    })?;
    report(&times, &losses.iter().map(|terms| terms.reconstruction + network.beta * terms.kl).collect::<Vec<f32>>())
}

/// From the listed cloud to the map; with its neighbours given; and another code on an encoded cloud.
fn sample(network: &NetworkConfig, examples: &[Example], steps: usize) -> Result<(), Box<dyn Error>> {
    let warmed = warmed(network, examples)?;
    let contacts = ContactNetwork::load(&warmed.checkpoint());
    let latent = vec![LATENT; network.latent_size];
    let scene = contacts.encode(&examples[0].points, &examples[0].colors)?;
    let whole = || done(contacts.map(&examples[0].points, &examples[0].colors, &latent));
    let given = || done(contacts.decode(&warmed.encode(&contacts, 0), &latent));
    let code = || done(contacts.decode(&scene, &latent));
    whole()?;
    let (whole, given, code) = (timed(steps, whole)?, timed(steps, given)?, timed(steps, code)?);
    println!("{}", serde_json::json!({"whole": whole, "given": given, "code": code, "vm_hwm_kib": memory("VmHWM:")?}));
    Ok(())
}

/// Whether a map could be made; the map itself is thrown away.
fn done<T, E: Error + 'static>(map: Result<T, E>) -> Result<(), Box<dyn Error>> {
    map?;
    Ok(())
}

/// CPU and wall seconds of each repetition.
fn timed(steps: usize, mut work: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<Vec<[f64; 2]>, Box<dyn Error>> {
    let mut times = Vec::new();
    for _ in 0..steps {
        let (wall, cpu) = (Instant::now(), cpu_seconds()?);
        work()?;
        times.push([cpu_seconds()? - cpu, wall.elapsed().as_secs_f64()]);
    }
    Ok(times)
}

fn report(times: &[[f64; 2]], losses: &[f32]) -> Result<(), Box<dyn Error>> {
    println!("{}", serde_json::json!({"times": times, "losses": losses, "vm_hwm_kib": memory("VmHWM:")?}));
    Ok(())
}

/// CPU time of all threads of this process as the kernel's scheduler counts it (s); only Linux tells.
fn cpu_seconds() -> Result<f64, Box<dyn Error>> {
    let mut total = 0.0;
    for task in fs::read_dir("/proc/self/task")? {
        let text = fs::read_to_string(task?.path().join("schedstat"))?;
        total += text.split(' ').next().ok_or("an empty schedstat")?.parse::<f64>()? * 1e-9;
    }
    Ok(total)
}

/// A line of /proc/self/status (KiB).
fn memory(field: &str) -> Result<u64, Box<dyn Error>> {
    let text = fs::read_to_string("/proc/self/status")?;
    let line = text.lines().find(|line| line.starts_with(field)).ok_or("no such line in /proc/self/status")?;
    Ok(line.split_whitespace().nth(1).ok_or("an empty line")?.parse()?)
}
