//! Every number a network holds, by name and shape, and how it starts.

use vmao_core::random::Stream;

/// Place of one array in the layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct ParameterId(pub(crate) usize);

/// How an array starts, and with it whether it is trained.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Start {
    /// Normal with this standard deviation; trained.
    Normal(f32),
    /// All equal; trained.
    Constant(f32),
    /// All equal; a running statistic, moved by the batches and not by the gradient.
    Statistic(f32),
}

/// Name, shape and start of one array. Weights are inputs × channels; vectors have one row.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Spec {
    pub(crate) name: String,
    pub(crate) shape: [usize; 2],
    pub(crate) start: Start,
}

impl Spec {
    /// Whether the optimiser moves it.
    pub(crate) fn is_trained(&self) -> bool {
        !matches!(self.start, Start::Statistic(_))
    }

    /// Number of elements.
    pub(crate) fn len(&self) -> usize {
        self.shape[0] * self.shape[1]
    }
}

/// The arrays of one network, in the order in which its layers asked for them.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Layout {
    specs: Vec<Spec>,
}

impl Layout {
    /// Adds an array.
    pub(crate) fn add(&mut self, name: String, shape: [usize; 2], start: Start) -> ParameterId {
        self.specs.push(Spec { name, shape, start });
        ParameterId(self.specs.len() - 1)
    }

    /// All arrays.
    pub(crate) fn specs(&self) -> &[Spec] {
        &self.specs
    }

    /// Start values; array i draws from its own stream, so adding one leaves the others as they were.
    pub(crate) fn start(&self, seed: u64) -> Parameters {
        let value = |(i, spec): (usize, &Spec)| match spec.start {
            Start::Normal(deviation) => {
                let mut stream = Stream::new(seed, &[LABEL_START, i as u64]);
                (0..spec.len()).map(|_| (stream.normal() * f64::from(deviation)) as f32).collect()
            }
            Start::Constant(value) | Start::Statistic(value) => vec![value; spec.len()],
        };
        Parameters { values: self.specs.iter().enumerate().map(value).collect() }
    }
}

/// Stream label of start values.
const LABEL_START: u64 = 1;

/// The values of a layout's arrays, row-major.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Parameters {
    pub(crate) values: Vec<Vec<f32>>,
}

impl Parameters {
    /// The array at `id`.
    pub(crate) fn get(&self, id: ParameterId) -> &[f32] {
        &self.values[id.0]
    }
}
