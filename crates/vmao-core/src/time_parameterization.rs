//! Timing of joint paths within velocity and acceleration limits.
//!
//! Corners are cut by parabolas, which makes the path C1 with a second derivative constant in each piece. The fastest
//! rate along it comes from a backward and a forward pass over squared rates (reachability analysis, Pham & Pham 2018);
//! because rates squared are linear between grid points the limits hold everywhere, not only at them. A moving average
//! over [`SMOOTHING_WINDOW`] then makes the acceleration continuous: averages never exceed the limits either.

use crate::robots::RobotModel;

/// Width of the moving average (s): moves the path by at most a·w²/24, under 0.0014 rad for the fastest Panda joint.
pub const SMOOTHING_WINDOW: f64 = 0.04;

/// What each joint can do.
#[derive(Debug, Clone, PartialEq)]
pub struct MotionLimits {
    /// Highest speed (rad/s).
    pub velocity: Vec<f64>,
    /// Highest acceleration (rad/s²).
    pub acceleration: Vec<f64>,
}

impl MotionLimits {
    /// All that these arms can do, arm after arm.
    pub fn of(robots: &[RobotModel]) -> Self {
        let joints = || robots.iter().flat_map(|robot| &robot.joints);
        Self {
            velocity: joints().map(|joint| joint.max_velocity).collect(),
            acceleration: joints().map(|joint| joint.max_acceleration).collect(),
        }
    }
}

/// Joint positions as a function of time, at rest at both ends, with continuous velocity and acceleration.
#[derive(Debug, Clone, PartialEq)]
pub struct Trajectory {
    knots: Vec<Knot>,
    end: Vec<f64>,
    /// Integral of the positions up to the end of the last knot.
    whole: Vec<f64>,
    raw_duration: f64,
}

/// Between two grid points: path derivatives at its start and the constant second rate of the path parameter.
#[derive(Debug, Clone, PartialEq)]
struct Knot {
    time: f64,
    rate: f64,
    second_rate: f64,
    q: Vec<f64>,
    slope: Vec<f64>,
    curvature: Vec<f64>,
    /// Integral of the positions from time zero to here.
    integral: Vec<f64>,
}

/// A stretch of the path: q(s) = q + slope·s + curvature·s²/2 for s in [0, length].
struct Piece {
    length: f64,
    q: Vec<f64>,
    slope: Vec<f64>,
    curvature: Vec<f64>,
    stops_at_end: bool,
}

impl Trajectory {
    /// The fastest motion along `path` within `limits` that leaves no waypoint by more than `deviation` (rad, ≥ 0).
    ///
    /// Corners are cut within `deviation` of the path (Euclidean over all joints); with 0 the motion stops at each.
    /// Panics if the path is empty, or if its points and the limits differ in length, or a limit is not positive.
    pub fn new(path: &[Vec<f64>], limits: &MotionLimits, deviation: f64) -> Self {
        assert!(!path.is_empty(), "a path has at least one point");
        let joints = path[0].len();
        assert!(path.iter().all(|q| q.len() == joints), "all points of a path have the same joints");
        assert!(limits.velocity.len() == joints && limits.acceleration.len() == joints, "limits for each of {joints} joints");
        assert!(limits.velocity.iter().chain(&limits.acceleration).all(|&limit| limit > 0.0), "limits are positive");
        let grid = Grid::new(&pieces(path, deviation), limits);
        let squares = grid.fastest(limits);
        let mut knots: Vec<Knot> = Vec::with_capacity(grid.cells.len());
        let (mut time, mut integral) = (0.0, vec![0.0; joints]);
        for (i, cell) in grid.cells.iter().enumerate() {
            let (rate, next) = (squares[i].sqrt(), squares[i + 1].sqrt());
            let second_rate = (squares[i + 1] - squares[i]) / (2.0 * cell.length);
            let (q, slope, curvature) = (cell.q.clone(), cell.slope.clone(), cell.curvature.clone());
            let knot = Knot { time, rate, second_rate, q, slope, curvature, integral: integral.clone() };
            let duration = 2.0 * cell.length / (rate + next);
            integral = knot.integral_after(duration);
            time += duration;
            knots.push(knot);
        }
        Self { knots, end: path[path.len() - 1].clone(), whole: integral, raw_duration: time }
    }

    /// Time from start to end (s); zero for a path that goes nowhere.
    pub fn duration(&self) -> f64 {
        if self.knots.is_empty() { 0.0 } else { self.raw_duration + SMOOTHING_WINDOW }
    }

    /// Joint positions (rad) and velocities (rad/s) at `time` (s); at rest before the start and after the end.
    pub fn at(&self, time: f64) -> (Vec<f64>, Vec<f64>) {
        if self.knots.is_empty() || time >= self.duration() {
            return (self.end.clone(), vec![0.0; self.end.len()]);
        }
        if time <= 0.0 {
            return (self.knots[0].q.clone(), vec![0.0; self.end.len()]);
        }
        let before = time - SMOOTHING_WINDOW;
        let mean = |late: Vec<f64>, early: Vec<f64>| late.iter().zip(&early).map(|(a, b)| (a - b) / SMOOTHING_WINDOW).collect();
        (mean(self.integral(time), self.integral(before)), mean(self.raw(time).0, self.raw(before).0))
    }

    /// Joint accelerations at `time` (rad/s²): what a torque feed-forward needs.
    pub fn acceleration(&self, time: f64) -> Vec<f64> {
        let (late, early) = (self.raw(time).1, self.raw(time - SMOOTHING_WINDOW).1);
        late.iter().zip(&early).map(|(a, b)| (a - b) / SMOOTHING_WINDOW).collect()
    }

    fn knot_at(&self, time: f64) -> &Knot {
        let after = self.knots.partition_point(|knot| knot.time <= time);
        &self.knots[after.saturating_sub(1)]
    }

    /// Positions and velocities before smoothing.
    fn raw(&self, time: f64) -> (Vec<f64>, Vec<f64>) {
        if self.knots.is_empty() || time >= self.raw_duration {
            return (self.end.clone(), vec![0.0; self.end.len()]);
        }
        let knot = self.knot_at(time.max(0.0));
        let t = time.max(0.0) - knot.time;
        let (s, rate) = (knot.rate * t + 0.5 * knot.second_rate * t * t, knot.rate + knot.second_rate * t);
        let joint = |i: usize| {
            let (slope, curvature) = (knot.slope[i], knot.curvature[i]);
            (knot.q[i] + s * (slope + 0.5 * curvature * s), (slope + curvature * s) * rate)
        };
        (0..self.end.len()).map(joint).unzip()
    }

    /// Integral of the unsmoothed positions from zero to `time`, the ends prolonged at rest.
    fn integral(&self, time: f64) -> Vec<f64> {
        if time < 0.0 {
            return self.knots[0].q.iter().map(|q| q * time).collect();
        }
        if time >= self.raw_duration {
            return self.whole.iter().zip(&self.end).map(|(sum, q)| sum + q * (time - self.raw_duration)).collect();
        }
        let knot = self.knot_at(time);
        knot.integral_after(time - knot.time)
    }
}

impl Knot {
    /// Integral of the positions from time zero to `t` after this knot; q(t) is a polynomial of degree four.
    fn integral_after(&self, t: f64) -> Vec<f64> {
        let (v, u) = (self.rate, self.second_rate);
        let joint = |i: usize| {
            let (q, d, c) = (self.q[i], self.slope[i], 0.5 * self.curvature[i]);
            let quartic = c * u * u / 4.0;
            let inner = (0.5 * d * u + c * v * v) / 3.0 + t * (c * v * u / 4.0 + t * quartic / 5.0);
            self.integral[i] + t * (q + t * (0.5 * d * v + t * inner))
        };
        (0..self.q.len()).map(joint).collect()
    }
}

/// Lines and corner parabolas of `path`, each parametrised so that the slope is a unit vector at both of its ends.
fn pieces(path: &[Vec<f64>], deviation: f64) -> Vec<Piece> {
    const SAME_POINT: f64 = 1e-9; // rad
    let mut points: Vec<&Vec<f64>> = Vec::new();
    for q in path {
        if points.last().is_none_or(|last| norm(&minus(q, last)) > SAME_POINT) {
            points.push(q);
        }
    }
    let edges: Vec<Vec<f64>> = points.windows(2).map(|edge| minus(edge[1], edge[0])).collect();
    let lengths: Vec<f64> = edges.iter().map(|edge| norm(edge)).collect();
    let units: Vec<Vec<f64>> =
        edges.iter().zip(&lengths).map(|(edge, length)| edge.iter().map(|x| x / length).collect()).collect();
    // how far from its corner each parabola begins and ends; its middle is cut·|turn|/4 away from the corner
    let cut = |corner: usize| {
        let turn = norm(&minus(&units[corner], &units[corner - 1]));
        if turn < 1e-9 { 0.0 } else { (4.0 * deviation / turn).min(0.5 * lengths[corner - 1]).min(0.5 * lengths[corner]) }
    };
    let cuts: Vec<f64> = (0..=edges.len()).map(|i| if i == 0 || i == edges.len() { 0.0 } else { cut(i) }).collect();
    let mut pieces = Vec::new();
    for (i, unit) in units.iter().enumerate() {
        let length = lengths[i] - cuts[i] - cuts[i + 1];
        let straight = i + 1 == units.len() || norm(&minus(&units[i + 1], unit)) < 1e-9;
        let stops_at_end = cuts[i + 1] == 0.0 && !straight;
        let q: Vec<f64> = points[i].iter().zip(unit).map(|(q, u)| q + u * cuts[i]).collect();
        if length > SAME_POINT {
            pieces.push(Piece { length, q, slope: unit.clone(), curvature: vec![0.0; unit.len()], stops_at_end });
        }
        if cuts[i + 1] > 0.0 {
            let q = points[i + 1].iter().zip(unit).map(|(q, u)| q - u * cuts[i + 1]).collect();
            let length = 2.0 * cuts[i + 1];
            let curvature = minus(&units[i + 1], unit).iter().map(|x| x / length).collect();
            pieces.push(Piece { length, q, slope: unit.clone(), curvature, stops_at_end: false });
        }
    }
    pieces
}

/// One step of the grid: derivatives at its start, the slope at its end, and the highest squared rate at both.
struct Cell {
    length: f64,
    q: Vec<f64>,
    slope: Vec<f64>,
    end_slope: Vec<f64>,
    curvature: Vec<f64>,
}

struct Grid {
    cells: Vec<Cell>,
    /// Highest squared rate at each grid point that the velocity limits allow; zero where the motion must stop.
    caps: Vec<f64>,
}

impl Grid {
    fn new(pieces: &[Piece], limits: &MotionLimits) -> Self {
        const CELLS: f64 = 200.0;
        const LEAST_CELLS: f64 = 6.0; // per piece
        let spacing = pieces.iter().map(|piece| piece.length).sum::<f64>() / CELLS;
        let (mut cells, mut caps) = (Vec::new(), vec![0.0]);
        for piece in pieces {
            let count = (piece.length / spacing).ceil().max(LEAST_CELLS) as usize;
            let length = piece.length / count as f64;
            let slope_at = |s: f64| -> Vec<f64> { piece.slope.iter().zip(&piece.curvature).map(|(d, c)| d + c * s).collect() };
            for i in 0..count {
                let s = length * i as f64;
                let along = |j: usize| piece.q[j] + s * (piece.slope[j] + 0.5 * piece.curvature[j] * s);
                let q = (0..piece.q.len()).map(along).collect();
                let (slope, end_slope) = (slope_at(s), slope_at(s + length));
                // the slope is linear between the ends, so a rate that is right for both ends is right between
                let steepest = slope.iter().zip(&end_slope).map(|(a, b)| a.abs().max(b.abs()));
                let cap = steepest.zip(&limits.velocity).map(|(slope, v)| (v / slope).powi(2)).fold(f64::INFINITY, f64::min);
                if let Some(before) = caps.last_mut() {
                    *before = cap.min(*before);
                }
                caps.push(if i + 1 == count && piece.stops_at_end { 0.0 } else { cap });
                cells.push(Cell { length, q, slope, end_slope, curvature: piece.curvature.clone() });
            }
        }
        if let Some(last) = caps.last_mut() {
            *last = 0.0;
        }
        Self { cells, caps }
    }

    /// The highest squared rate at each grid point from which the motion can still end at rest within the limits.
    fn fastest(&self, limits: &MotionLimits) -> Vec<f64> {
        const HALVINGS: usize = 50;
        let mut reachable = self.caps.clone();
        for (i, cell) in self.cells.iter().enumerate().rev() {
            let possible = |square: f64| cell.second_rates(square, reachable[i + 1], limits).is_some();
            if possible(reachable[i]) {
                continue;
            }
            let (mut low, mut high) = (0.0, reachable[i]);
            for _ in 0..HALVINGS {
                let middle = 0.5 * (low + high);
                if possible(middle) { low = middle } else { high = middle }
            }
            reachable[i] = low;
        }
        let mut squares = vec![0.0];
        for (i, cell) in self.cells.iter().enumerate() {
            let square = squares[i];
            // rounding can leave the forward pass a hair outside what the backward pass found possible
            let highest = cell.second_rates(square * (1.0 - 1e-9), reachable[i + 1], limits).map_or(0.0, |[_, highest]| highest);
            squares.push((square + 2.0 * cell.length * highest).clamp(0.0, reachable[i + 1]));
        }
        squares
    }
}

impl Cell {
    /// Least and greatest second rate u over this cell from the squared rate x, `None` if the limits leave none.
    ///
    /// |q″x + q′u| ≤ a at both ends, with x + 2Δu at the far one, which must lie in [0, `next`].
    fn second_rates(&self, x: f64, next: f64, limits: &MotionLimits) -> Option<[f64; 2]> {
        let (mut low, mut high) = (-x / (2.0 * self.length), (next - x) / (2.0 * self.length));
        for (j, &a) in limits.acceleration.iter().enumerate() {
            let bend = self.curvature[j] * x;
            for slope in [self.slope[j], self.end_slope[j] + 2.0 * self.length * self.curvature[j]] {
                if slope.abs() < 1e-12 {
                    if bend.abs() > a {
                        return None;
                    }
                    continue;
                }
                let (one, other) = ((-a - bend) / slope, (a - bend) / slope);
                low = low.max(one.min(other));
                high = high.min(one.max(other));
            }
        }
        (low <= high).then_some([low, high])
    }
}

fn minus(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(x, y)| x - y).collect()
}

fn norm(a: &[f64]) -> f64 {
    a.iter().map(|x| x * x).sum::<f64>().sqrt()
}
