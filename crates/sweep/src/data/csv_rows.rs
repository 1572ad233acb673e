//! Tables of comma-separated values.

use std::io::{self, Write};

/// Writes a header row and rows of as many cells.
pub(crate) fn write<'n, H, R, C>(
    header: H,
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()>
where
    H: IntoIterator<Item = &'n str>,
    R: IntoIterator<Item = C>,
    C: AsRef<[u8]>,
{
    let mut table = csv::Writer::from_writer(out);
    table.write_record(header).map_err(io_error)?;
    for row in rows {
        table.write_record(row).map_err(io_error)?;
    }
    table.flush()
}

/// Writes rows without a header.
pub(crate) fn write_rows<R, C>(
    rows: impl IntoIterator<Item = R>,
    out: &mut dyn Write,
) -> io::Result<()>
where
    R: IntoIterator<Item = C>,
    C: AsRef<[u8]>,
{
    let mut table = csv::Writer::from_writer(out);
    for row in rows {
        table.write_record(row).map_err(io_error)?;
    }
    table.flush()
}

/// The system error. The conversion of the `csv` crate would hide its kind.
fn io_error(error: csv::Error) -> io::Error {
    match error.into_kind() {
        csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Output with a closed reader.
    struct Closed;

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::ErrorKind::BrokenPipe.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn cells_are_quoted_where_they_must_be() {
        let mut bytes = Vec::new();
        write(["a", "b"], [["1", "x, y"], ["", "\"z\""]], &mut bytes).unwrap();
        assert_eq!(bytes, b"a,b\n1,\"x, y\"\n,\"\"\"z\"\"\"\n");
    }

    #[test]
    fn a_closed_reader_is_detected_for_tables_of_any_length() {
        for rows in [1, 100_000] {
            let table = std::iter::repeat_n(["1.5"], rows);
            let error = write(["a"], table, &mut Closed).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::BrokenPipe, "{rows}");
        }
    }

    #[test]
    fn rows_of_another_length_are_refused() {
        assert!(write(["a", "b"], [["1"]], &mut Vec::new()).is_err());
    }
}
