//! Reading bytes that nobody vouches for.

use std::{
    fs::File,
    io::{BufRead, BufReader, Read as _},
    path::Path,
};

use crate::{IoError, error::Fault};

/// Longest line of a header, bytes.
const LINE_LIMIT: u64 = 4096;

/// Opens a file for reading and hands it to `parse`.
pub(crate) fn read_file<T>(
    path: &Path,
    parse: impl FnOnce(&mut BufReader<File>) -> Result<T, Fault>,
) -> Result<T, IoError> {
    File::open(path)
        .map_err(Fault::Io)
        .and_then(|file| parse(&mut BufReader::with_capacity(1 << 16, file)))
        .map_err(|fault| fault.in_file(path))
}

/// The next `N` bytes.
pub(crate) fn exact<const N: usize>(source: &mut impl BufRead) -> Result<[u8; N], Fault> {
    let mut bytes = [0; N];
    source.read_exact(&mut bytes)?;
    Ok(bytes)
}

/// The next line of a header without its end.
pub(crate) fn line(source: &mut impl BufRead) -> Result<String, Fault> {
    let mut bytes = Vec::new();
    source.take(LINE_LIMIT).read_until(b'\n', &mut bytes)?;
    if bytes.pop_if(|last| *last == b'\n').is_none() {
        return Fault::damaged(if bytes.len() as u64 == LINE_LIMIT {
            format!("a header line is longer than {LINE_LIMIT} bytes")
        } else {
            "it ends inside the header".to_owned()
        });
    }
    let line = String::from_utf8_lossy(&bytes);
    Ok(line.trim_end().to_owned())
}

/// Checks that no byte is left.
pub(crate) fn end(source: &mut impl BufRead) -> Result<(), Fault> {
    if source.fill_buf()?.is_empty() {
        Ok(())
    } else {
        Fault::damaged("bytes follow where the data should end")
    }
}
