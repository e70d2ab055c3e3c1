//! Sums over an inverse index: the backward of a gather, one owner per sum, in a fixed order.
//!
//! burn's own backward of a selected index walks all picked rows with one GPU thread per channel.

use crate::kernels::gather::Picks;
use burn::tensor::backend::Backend;
use burn::tensor::ops::Device;
use burn::tensor::{Int, Tensor, TensorData};

/// The inverse lists of [`Picks`] on a device: segment t is `rows[starts[t]..starts[t + 1]]`, ascending.
#[derive(Debug, Clone)]
pub(crate) struct Segments<B: Backend> {
    /// One more than there are segments.
    starts: Tensor<B, 1, Int>,
    /// One for each picked row.
    rows: Tensor<B, 1, Int>,
}

impl<B: Backend> Segments<B> {
    /// Brings the lists to `device`.
    pub(crate) fn new(picks: &Picks, device: &Device<B>) -> Self {
        let (starts, rows) = picks.inverse();
        Self { starts: indices(starts, device), rows: indices(rows, device) }
    }
}

/// Row numbers on a device.
pub(crate) fn indices<B: Backend>(rows: &[u32], device: &Device<B>) -> Tensor<B, 1, Int> {
    let values: Vec<i32> = rows.iter().map(|&row| row as i32).collect();
    Tensor::from_data(TensorData::new(values, [rows.len()]), device)
}

/// A backend that sums segments of rows in parallel and always in the same order.
pub(crate) trait SegmentSum: Backend {
    /// out[t, c] = Σ of values[r, c] over the rows r of segment t, in ascending order; `values` picked rows × channels.
    fn segment_sum(values: Tensor<Self, 2>, segments: &Segments<Self>) -> Tensor<Self, 2>;
}

/// The kernel's arithmetic, serial: what the composed operations are tested with where there is no GPU.
#[cfg(test)]
impl SegmentSum for burn::backend::Flex {
    fn segment_sum(values: Tensor<Self, 2>, segments: &Segments<Self>) -> Tensor<Self, 2> {
        let ([_, channels], device) = (values.dims(), values.device());
        let values = values.into_data().into_vec::<f32>().unwrap();
        let list = |list: &Tensor<Self, 1, Int>| list.clone().into_data().convert::<i32>().into_vec::<i32>().unwrap();
        let (starts, rows) = (list(&segments.starts), list(&segments.rows));
        let own = |unit: usize| {
            let (segment, channel) = (unit / channels, unit % channels);
            let mut sum = 0.0;
            for i in starts[segment]..starts[segment + 1] {
                sum += values[rows[i as usize] as usize * channels + channel];
            }
            sum
        };
        let out: Vec<f32> = (0..(starts.len() - 1) * channels).map(own).collect();
        Tensor::from_data(TensorData::new(out, [starts.len() - 1, channels]), &device)
    }
}

#[cfg(feature = "cubecl")]
mod kernel {
    use super::{SegmentSum, Segments};
    use burn::tensor::{Tensor, TensorPrimitive};
    use burn_cubecl::kernel::into_contiguous;
    use burn_cubecl::ops::numeric::empty_device_contiguous_dtype;
    use burn_cubecl::{BoolElement, CubeBackend, CubeRuntime};
    use cubecl::prelude::*;
    use cubecl::{CubeDim, calculate_cube_count_elemwise};

    /// One unit for each number of `out`: neighbouring units own neighbouring channels, so they read and write side by side.
    #[cube(launch)]
    fn segment_sum_kernel(values: &Array<f32>, starts: &Array<i32>, rows: &Array<i32>, out: &mut Array<f32>, channels: usize) {
        if ABSOLUTE_POS < out.len() {
            let segment = ABSOLUTE_POS / channels;
            let channel = ABSOLUTE_POS % channels;
            let mut sum = f32::new(0.0);
            let first = usize::cast_from(starts[segment]);
            let end = usize::cast_from(starts[segment + 1]);
            for i in first..end {
                let row = usize::cast_from(rows[i]);
                sum += values[row * channels + channel];
            }
            out[ABSOLUTE_POS] = sum;
        }
    }

    impl<R: CubeRuntime, BT: BoolElement> SegmentSum for CubeBackend<R, f32, i32, BT> {
        fn segment_sum(values: Tensor<Self, 2>, segments: &Segments<Self>) -> Tensor<Self, 2> {
            let ([_, channels], [starts]) = (values.dims(), segments.starts.dims());
            let values = into_contiguous(values.into_primitive().tensor());
            let (starts_list, rows) = (
                into_contiguous(segments.starts.clone().into_primitive()),
                into_contiguous(segments.rows.clone().into_primitive()),
            );
            let (client, device) = (values.client.clone(), values.device.clone());
            let units = (starts - 1) * channels;
            let out = empty_device_contiguous_dtype(client.clone(), device, [starts - 1, channels].into(), values.dtype);
            let block = CubeDim::new(&client, units);
            segment_sum_kernel::launch::<R>(
                &client,
                calculate_cube_count_elemwise(&client, units, block),
                block,
                values.into_array_arg(),
                starts_list.into_array_arg(),
                rows.into_array_arg(),
                out.clone().into_array_arg(),
                channels,
            );
            Tensor::from_primitive(TensorPrimitive::Float(out))
        }
    }
}
