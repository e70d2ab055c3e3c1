//! Matrix products of row-major slices, single-threaded: callers parallelise over blocks of rows.

use gemm::{Parallelism, gemm};

/// A matrix read from a row-major slice, possibly transposed.
#[derive(Debug, Clone, Copy)]
pub(crate) struct View<'a> {
    data: &'a [f32],
    rows: usize,
    cols: usize,
    row_stride: usize,
    col_stride: usize,
}

impl<'a> View<'a> {
    /// The `rows` × `cols` matrix whose rows lie one after the other in `data`.
    pub(crate) fn new(data: &'a [f32], rows: usize, cols: usize) -> Self {
        assert_eq!(data.len(), rows * cols, "a {rows} x {cols} matrix");
        Self { data, rows, cols, row_stride: cols, col_stride: 1 }
    }

    /// Its transpose, nothing moved.
    pub(crate) fn transposed(self) -> Self {
        Self { rows: self.cols, cols: self.rows, row_stride: self.col_stride, col_stride: self.row_stride, ..self }
    }
}

/// `out` = `left` · `right`, or `out` += `left` · `right` with [`Write::Add`]; `out` is row-major.
pub(crate) fn product(out: &mut [f32], write: Write, left: View<'_>, right: View<'_>) {
    let (m, n, k) = (left.rows, right.cols, left.cols);
    assert_eq!(k, right.rows, "inner sizes of a matrix product");
    assert_eq!(out.len(), m * n, "a {m} x {n} product");
    if m == 0 || n == 0 {
        return;
    }
    if k == 0 {
        if write == Write::Replace {
            out.fill(0.0);
        }
        return;
    }
    #[expect(unsafe_code, reason = "gemm takes raw pointers; no safe crate is as fast")]
    // SAFETY: `View` guarantees that (i, j) of each operand, i < rows and j < cols, lies at i·row_stride + j·col_stride inside its
    // slice (checked in `View::new`; transposing swaps both pairs). `out` holds m·n elements, was checked above, and as the only
    // mutable borrow overlaps neither operand.
    unsafe {
        gemm(
            m,
            n,
            k,
            out.as_mut_ptr(),
            1,
            n as isize,
            write == Write::Add,
            left.data.as_ptr(),
            left.col_stride as isize,
            left.row_stride as isize,
            right.data.as_ptr(),
            right.col_stride as isize,
            right.row_stride as isize,
            1.0,
            1.0,
            false,
            false,
            false,
            Parallelism::None,
        );
    }
}

/// Whether a product replaces the output or is added to it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Write {
    /// out = …
    Replace,
    /// out += …
    Add,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_product_is_the_sum_over_the_inner_index() {
        let a: Vec<f32> = (0..6).map(|i| i as f32).collect(); // 2 x 3
        let b: Vec<f32> = (0..12).map(|i| (i as f32) - 4.0).collect(); // 3 x 4
        let mut out = vec![1.0; 8];
        product(&mut out, Write::Add, View::new(&a, 2, 3), View::new(&b, 3, 4));
        for (i, j) in (0..2).flat_map(|i| (0..4).map(move |j| (i, j))) {
            let expected: f32 = 1.0 + (0..3).map(|k| a[i * 3 + k] * b[k * 4 + j]).sum::<f32>();
            assert_eq!(out[i * 4 + j], expected);
        }
    }

    #[test]
    fn transposes_are_read_in_place() {
        let a: Vec<f32> = (0..6).map(|i| i as f32).collect(); // 3 x 2, read as 2 x 3
        let b: Vec<f32> = (0..12).map(|i| (i as f32) * 0.5).collect(); // 4 x 3, read as 3 x 4
        let mut out = vec![7.0; 8];
        product(&mut out, Write::Replace, View::new(&a, 3, 2).transposed(), View::new(&b, 4, 3).transposed());
        for (i, j) in (0..2).flat_map(|i| (0..4).map(move |j| (i, j))) {
            assert_eq!(out[i * 4 + j], (0..3).map(|k| a[k * 2 + i] * b[j * 3 + k]).sum::<f32>());
        }
    }

    #[test]
    fn an_empty_inner_size_gives_zero() {
        let mut out = vec![7.0; 4];
        product(&mut out, Write::Replace, View::new(&[], 2, 0), View::new(&[], 0, 2));
        assert_eq!(out, vec![0.0; 4]);
    }
}
