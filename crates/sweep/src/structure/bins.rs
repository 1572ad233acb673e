//! Histograms.

/// The bins of a histogram, by their edges.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Bins {
    edges: Vec<f64>,
}

impl Bins {
    /// A number of bins of equal width between two ends.
    pub(super) fn equal(from: f64, to: f64, number: usize) -> Self {
        let width = (to - from) / number as f64;
        Self {
            edges: (0..=number).map(|k| from + width * k as f64).collect(),
        }
    }

    /// These bins, followed by bins of about this width up to an end.
    #[must_use]
    pub(super) fn and_then(mut self, to: f64, width: f64) -> Self {
        if let Some(&from) = self.edges.last()
            && to > from
        {
            let number = crate::text::format::count(((to - from) / width).round()).max(1);
            let more = Self::equal(from, to, number);
            self.edges.extend(more.edges.into_iter().skip(1));
        }
        self
    }

    /// Number of bins.
    pub(super) fn len(&self) -> usize {
        self.edges.len().saturating_sub(1)
    }

    /// The bin of a value; a bin includes its lower edge, but not its upper one.
    pub(super) fn place(&self, value: f64) -> Option<usize> {
        let above = self.edges.partition_point(|edge| *edge <= value);
        (1..self.edges.len()).contains(&above).then(|| above - 1)
    }

    /// The ends of each bin.
    pub(super) fn ends(&self) -> impl Iterator<Item = (f64, f64)> {
        self.edges.windows(2).map(|ends| (ends[0], ends[1]))
    }

    /// The centre of each bin.
    pub(super) fn middles(&self) -> Vec<f64> {
        self.ends().map(|(low, high)| 0.5 * (low + high)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_at_an_edge_are_in_the_upper_bin() {
        let bins = Bins::equal(2.0, 3.0, 4).and_then(5.0, 0.5);
        assert_eq!(bins.len(), 8);
        let places = [1.9, 2.0, 2.24, 2.25, 2.999, 3.0, 4.99, 5.0].map(|x| bins.place(x));
        let wanted = [
            None,
            Some(0),
            Some(0),
            Some(1),
            Some(3),
            Some(4),
            Some(7),
            None,
        ];
        assert_eq!(places, wanted);
        assert_eq!(bins.middles()[7], 4.75);
        assert_eq!(bins.place(f64::NAN), None);
    }
}
