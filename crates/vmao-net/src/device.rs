//! What trains, chosen when the program runs: the CPU, or a GPU where this build and this machine have one.

use crate::batch::Batch;
use crate::cvae::Cvae;
use crate::error::Error;
use crate::objective::{Objective, objective};
use crate::operations::Fused;
use crate::parameters::{Layout, Parameters};
use burn::backend::flex::FlexDevice;
use serde::{Deserialize, Serialize};

/// What computes the steps of a training. Prediction always runs on the CPU.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Device {
    /// Bit-equal weights for any number of threads.
    #[default]
    Cpu,
    /// The first CUDA device; weights differ from the CPU's by rounding.
    Cuda,
}

impl Device {
    /// The name in documents.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            Self::Cuda => "cuda",
        }
    }

    /// The first CUDA device, after a small gather and its gradient came out right on it; else, in a few words, why there is none.
    pub fn cuda() -> Result<Self, String> {
        cuda::probe().map(|()| Self::Cuda)
    }

    /// The objective of a batch and its gradients; fails when the device does.
    pub(crate) fn objective(
        self,
        layers: (&Layout, &Cvae),
        parameters: &Parameters,
        batch: &Batch,
        noise: Vec<f32>,
        beta: f32,
    ) -> Result<Objective, Error> {
        match self {
            Self::Cpu => Ok(objective::<Fused>(layers, parameters, batch, noise, beta, &FlexDevice)),
            Self::Cuda => cuda::objective(layers, parameters, batch, noise, beta)
                .map_err(|reason| Error::Device { device: self.name().to_owned(), reason }),
        }
    }
}

#[cfg(not(feature = "cuda"))]
mod cuda {
    use crate::batch::Batch;
    use crate::cvae::Cvae;
    use crate::objective::Objective;
    use crate::parameters::{Layout, Parameters};

    const ABSENT: &str = "this program was built without CUDA (`--features cuda` builds it in)";

    pub(super) fn probe() -> Result<(), String> {
        Err(ABSENT.to_owned())
    }

    pub(super) fn objective(_: (&Layout, &Cvae), _: &Parameters, _: &Batch, _: Vec<f32>, _: f32) -> Result<Objective, String> {
        Err(ABSENT.to_owned())
    }
}

#[cfg(feature = "cuda")]
mod cuda {
    use crate::batch::Batch;
    use crate::cvae::Cvae;
    use crate::kernels::gather::Picks;
    use crate::objective::{Objective, objective as run};
    use crate::operations::{Composed, Operations, Rows};
    use crate::parameters::{Layout, Parameters};
    use burn::backend::Cuda;
    use burn::backend::cuda::CudaDevice;
    use burn::tensor::TensorData;
    use std::panic::{AssertUnwindSafe, catch_unwind, set_hook, take_hook};
    use std::sync::{Arc, Mutex, PoisonError};

    type Gpu = Composed<Cuda>;

    /// What `work` returns, or the first line of the first panic on the way: burn and its driver know no other way to fail.
    fn guarded<T>(work: impl FnOnce() -> T) -> Result<T, String> {
        let first: Arc<Mutex<Option<String>>> = Arc::default();
        let seen = Arc::clone(&first);
        let before = take_hook();
        set_hook(Box::new(move |panic| {
            let said = panic.payload_as_str().and_then(|text| text.lines().next()).unwrap_or("a panic without words");
            seen.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_with(|| said.to_owned());
        }));
        let result = catch_unwind(AssertUnwindSafe(work));
        set_hook(before);
        let said = first.lock().unwrap_or_else(PoisonError::into_inner).take();
        result.map_err(|_| said.unwrap_or_else(|| "a panic without words".to_owned()))
    }

    pub(super) fn probe() -> Result<(), String> {
        let found = guarded(|| {
            let device = CudaDevice::default();
            let picks = Gpu::picks(&Arc::new(Picks::new(vec![2, 0, 2], 3)), &device);
            let x = Rows::<Gpu>::from_data(TensorData::from([[1.0_f32, 2.0], [3.0, 4.0], [5.0, 6.0]]), &device).require_grad();
            let loss = Gpu::gather(x.clone(), &picks).powi_scalar(2).sum_dim(1).sum_dim(0);
            let gradient = x.grad(&loss.backward())?;
            gradient.into_data().into_vec::<f32>().ok()
        })?;
        // x² of rows 2, 0 and 2 has the gradient 2 x, twice for row 2; small whole numbers are exact.
        if found.as_ref().is_some_and(|found| *found == [2.0, 4.0, 0.0, 0.0, 20.0, 24.0]) {
            return Ok(());
        }
        Err(format!("a sum on it came out as {found:?}"))
    }

    pub(super) fn objective(
        layers: (&Layout, &Cvae),
        parameters: &Parameters,
        batch: &Batch,
        noise: Vec<f32>,
        beta: f32,
    ) -> Result<Objective, String> {
        guarded(|| run::<Gpu>(layers, parameters, batch, noise, beta, &CudaDevice::default()))
    }
}
