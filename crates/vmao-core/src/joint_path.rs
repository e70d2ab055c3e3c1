//! Paths and search trees in joint space, measured in the Euclidean norm over all joints.

/// Nodes of one search tree, root first.
pub(crate) struct Tree {
    width: usize,
    points: Vec<f64>,
    parents: Vec<usize>,
}

impl Tree {
    /// A tree of its root alone.
    pub(crate) fn new(root: &[f64]) -> Self {
        Self { width: root.len(), points: root.to_vec(), parents: vec![0] }
    }

    /// Number of nodes.
    pub(crate) fn len(&self) -> usize {
        self.parents.len()
    }

    /// The configuration of a node.
    pub(crate) fn point(&self, node: usize) -> &[f64] {
        &self.points[node * self.width..(node + 1) * self.width]
    }

    /// Adds a node and returns its index.
    pub(crate) fn push(&mut self, point: &[f64], parent: usize) -> usize {
        self.points.extend_from_slice(point);
        self.parents.push(parent);
        self.parents.len() - 1
    }

    /// The node nearest to `target`, Euclidean over all joints.
    pub(crate) fn nearest(&self, target: &[f64]) -> usize {
        let mut best = (f64::INFINITY, 0);
        for (node, point) in self.points.chunks_exact(self.width).enumerate() {
            let square = point.iter().zip(target).map(|(a, b)| (a - b) * (a - b)).sum();
            if square < best.0 {
                best = (square, node);
            }
        }
        best.1
    }

    /// From `node` back to the root.
    pub(crate) fn path_to(&self, node: usize) -> Vec<Vec<f64>> {
        let mut path = vec![self.point(node).to_vec()];
        let mut node = node;
        while node != 0 {
            node = self.parents[node];
            path.push(self.point(node).to_vec());
        }
        path
    }
}

/// The configuration a `fraction` of the way, exactly `to` at 1.
pub(crate) fn blend(from: &[f64], to: &[f64], fraction: f64) -> Vec<f64> {
    if fraction == 1.0 {
        return to.to_vec();
    }
    from.iter().zip(to).map(|(a, b)| a + (b - a) * fraction).collect()
}

/// The most any joint differs (rad).
pub(crate) fn largest_turn(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

/// Euclidean distance over all joints (rad).
pub(crate) fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y) * (x - y)).sum::<f64>().sqrt()
}

/// Length of a path (rad).
pub(crate) fn length(path: &[Vec<f64>]) -> f64 {
    path.windows(2).map(|edge| distance(&edge[0], &edge[1])).sum()
}

/// The edge and the point that lie `along` the path (rad).
pub(crate) fn at_length(path: &[Vec<f64>], along: f64) -> (usize, Vec<f64>) {
    let mut left = along;
    for (index, edge) in path.windows(2).enumerate() {
        let edge_length = distance(&edge[0], &edge[1]);
        if left < edge_length {
            return (index, blend(&edge[0], &edge[1], left / edge_length));
        }
        left -= edge_length;
    }
    (path.len() - 2, path[path.len() - 1].clone())
}

/// Drops waypoints that lie on the line between their neighbours.
pub(crate) fn remove_collinear(path: &mut Vec<Vec<f64>>) {
    let mut i = 1;
    while i + 1 < path.len() {
        let (before, after) = (distance(&path[i - 1], &path[i]), distance(&path[i], &path[i + 1]));
        if before + after - distance(&path[i - 1], &path[i + 1]) < 1e-12 * (before + after) {
            path.remove(i);
        } else {
            i += 1;
        }
    }
}
