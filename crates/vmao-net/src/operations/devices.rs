//! The code that a GPU runs, on each kind of device: exact against the CPU where only additions are made, against PyTorch elsewhere.

use super::Composed;
use super::segment_sum::{SegmentSum, Segments};
use crate::kernels::finite_difference::normal;
use crate::kernels::gather::Picks;
use crate::pytorch_goldens::{BOTTLENECK, EVERY_LEVEL, TOP1, compare};
use burn::tensor::{Tensor, TensorData};
use vmao_core::random::Stream;

/// Random picks with empty, short and long segments: the sums are the CPU's to the last bit.
fn sums_are_exact<B: SegmentSum>() {
    let device = Default::default();
    for (case, (picked, table, channels)) in
        [(1, 1, 1), (700, 83, 13), (5000, 3, 6), (40, 900, 1), (4096, 256, 64)].into_iter().enumerate()
    {
        let mut stream = Stream::new(case as u64, &[]);
        // Squares crowd the picks at the front, so that segments differ in length and some stay empty.
        let sources = (0..picked).map(|_| (table as f64 * stream.unit().powi(2)) as u32).collect();
        let picks = Picks::new(sources, table);
        let values = normal(case as u64, picked * channels);
        let tensor = Tensor::<B, 2>::from_data(TensorData::new(values.clone(), [picked, channels]), &device);
        let sums = B::segment_sum(tensor, &Segments::new(&picks, &device));
        assert_eq!(sums.dims(), [table, channels]);
        assert_eq!(sums.into_data().into_vec::<f32>().unwrap(), picks.scatter_add(&values, channels), "{picked} of {table}");
    }
}

fn objectives_agree_with_pytorch<B: SegmentSum>() {
    [EVERY_LEVEL, BOTTLENECK, TOP1].into_iter().for_each(compare::<Composed<B>>);
}

#[test]
fn the_kernels_arithmetic_gives_the_sums_of_the_cpu() {
    sums_are_exact::<burn::backend::Flex>();
}

#[test]
fn the_operations_that_a_gpu_runs_agree_with_pytorch() {
    objectives_agree_with_pytorch::<burn::backend::Flex>();
}

#[cfg(feature = "wgpu")]
#[test]
#[ignore = "needs a Vulkan device; Mesa's software one will do"]
fn a_vulkan_device_agrees() {
    sums_are_exact::<burn::backend::Wgpu>();
    objectives_agree_with_pytorch::<burn::backend::Wgpu>();
}

#[cfg(feature = "cuda")]
#[test]
#[ignore = "needs a CUDA device"]
fn a_cuda_device_agrees() {
    sums_are_exact::<burn::backend::Cuda>();
    objectives_agree_with_pytorch::<burn::backend::Cuda>();
}
