//! Rows picked by index, and the transpose of that: sums over an inverse index, one owner per row.

use super::blocks::{BLOCK, vectorised};
use rayon::prelude::*;

/// Which rows of a table are picked, with the inverse lists that make the backward sum deterministic.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Picks {
    /// For every picked row, the table row it comes from.
    pub(crate) sources: Vec<u32>,
    /// `rows[starts[t]..starts[t + 1]]` are the picked rows that come from table row t, ascending.
    starts: Vec<u32>,
    rows: Vec<u32>,
}

impl Picks {
    /// Sorts `sources` by counting; every source must be below `table_rows`.
    pub(crate) fn new(sources: Vec<u32>, table_rows: usize) -> Self {
        let mut starts = vec![0_u32; table_rows + 1];
        for &source in &sources {
            starts[source as usize + 1] += 1;
        }
        for t in 0..table_rows {
            starts[t + 1] += starts[t];
        }
        let mut next = starts.clone();
        let mut rows = vec![0_u32; sources.len()];
        for (row, &source) in sources.iter().enumerate() {
            rows[next[source as usize] as usize] = row as u32;
            next[source as usize] += 1;
        }
        Self { sources, starts, rows }
    }

    /// Rows of the table.
    pub(crate) fn table_rows(&self) -> usize {
        self.starts.len() - 1
    }

    /// The inverse lists: where each table row's own begins (and the end), and the picked rows that come from it.
    #[cfg(any(test, feature = "cubecl"))]
    pub(crate) fn inverse(&self) -> (&[u32], &[u32]) {
        (&self.starts, &self.rows)
    }

    /// The picked rows of `table`, one after the other.
    pub(crate) fn gather(&self, table: &[f32], channels: usize) -> Vec<f32> {
        assert_eq!(table.len(), self.table_rows() * channels, "a table of {} rows", self.table_rows());
        let mut out = vec![0.0; self.sources.len() * channels];
        out.par_chunks_mut(BLOCK * channels).zip(self.sources.par_chunks(BLOCK)).for_each(|(out, sources)| {
            for (row, &source) in out.chunks_exact_mut(channels).zip(sources) {
                row.copy_from_slice(&table[source as usize * channels..(source as usize + 1) * channels]);
            }
        });
        out
    }

    /// For every table row the sum of the rows picked from it: the transpose of [`Picks::gather`].
    pub(crate) fn scatter_add(&self, rows: &[f32], channels: usize) -> Vec<f32> {
        assert_eq!(rows.len(), self.sources.len() * channels, "{} picked rows", self.sources.len());
        let mut table = vec![0.0; self.table_rows() * channels];
        table.par_chunks_mut(BLOCK * channels).enumerate().for_each(|(block, chunk)| {
            vectorised(
                #[inline(always)]
                || {
                    for (t, out) in chunk.chunks_exact_mut(channels).enumerate() {
                        let t = block * BLOCK + t;
                        for &row in &self.rows[self.starts[t] as usize..self.starts[t + 1] as usize] {
                            let row = &rows[row as usize * channels..(row as usize + 1) * channels];
                            out.iter_mut().zip(row).for_each(|(sum, value)| *sum += value);
                        }
                    }
                },
            );
        });
        table
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scatter_add_is_the_transpose_of_gather() {
        let picks = Picks::new(vec![2, 0, 2, 2, 4], 5);
        let table: Vec<f32> = (0..10).map(|i| i as f32).collect();
        let rows: Vec<f32> = (0..10).map(|i| (i * i) as f32 - 3.0).collect();
        let gathered = picks.gather(&table, 2);
        assert_eq!(gathered, vec![4.0, 5.0, 0.0, 1.0, 4.0, 5.0, 4.0, 5.0, 8.0, 9.0]);
        let scattered = picks.scatter_add(&rows, 2);
        let dot = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f32>();
        assert_eq!(dot(&gathered, &rows), dot(&table, &scattered));
        assert_eq!(&scattered[2..4], &[0.0, 0.0], "row 1 was never picked");
    }
}
