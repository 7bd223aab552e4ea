use std::io::BufRead;

use crate::{bytes::exact, error::Fault};

/// Longest word of ascii data, bytes.
const WORD_LIMIT: usize = 512;

/// How the data is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    LittleEndian,
    BigEndian,
}

/// Type of a single value; an f64 holds every value of each exactly.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// The type of a name, of the original format or of the common sized kind.
    pub(super) fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    pub(super) const fn is_real(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// The next value.
    pub(super) fn read(self, source: &mut impl BufRead, encoding: Encoding) -> Result<f64, Fault> {
        if encoding == Encoding::Ascii {
            return self.read_word(source);
        }
        Ok(match self {
            Self::I8 => f64::from(i8::from_le_bytes(bytes(source, encoding)?)),
            Self::U8 => f64::from(u8::from_le_bytes(bytes(source, encoding)?)),
            Self::I16 => f64::from(i16::from_le_bytes(bytes(source, encoding)?)),
            Self::U16 => f64::from(u16::from_le_bytes(bytes(source, encoding)?)),
            Self::I32 => f64::from(i32::from_le_bytes(bytes(source, encoding)?)),
            Self::U32 => f64::from(u32::from_le_bytes(bytes(source, encoding)?)),
            Self::F32 => f64::from(f32::from_le_bytes(bytes(source, encoding)?)),
            Self::F64 => f64::from_le_bytes(bytes(source, encoding)?),
        })
    }

    fn read_word(self, source: &mut impl BufRead) -> Result<f64, Fault> {
        let Some(word) = word(source)? else {
            return Fault::damaged("it ends too early");
        };
        let value = match self {
            Self::I8 => word.parse::<i8>().ok().map(f64::from),
            Self::U8 => word.parse::<u8>().ok().map(f64::from),
            Self::I16 => word.parse::<i16>().ok().map(f64::from),
            Self::U16 => word.parse::<u16>().ok().map(f64::from),
            Self::I32 => word.parse::<i32>().ok().map(f64::from),
            Self::U32 => word.parse::<u32>().ok().map(f64::from),
            Self::F32 => word.parse::<f32>().ok().map(f64::from),
            Self::F64 => word.parse().ok(),
        };
        value.map_or_else(
            || Fault::damaged(format!("'{word}' is not a value of type {self:?}")),
            Ok,
        )
    }
}

/// The bytes of a value, lowest first.
fn bytes<const N: usize>(source: &mut impl BufRead, encoding: Encoding) -> Result<[u8; N], Fault> {
    let mut bytes = exact(source)?;
    if encoding == Encoding::BigEndian {
        bytes.reverse();
    }
    Ok(bytes)
}

/// The next word of ascii data and the one white space after it; `None` at the end.
pub(super) fn word(source: &mut impl BufRead) -> Result<Option<String>, Fault> {
    let mut word = Vec::new();
    while let [byte, ..] = *source.fill_buf()? {
        source.consume(1);
        if !byte.is_ascii_whitespace() {
            word.push(byte);
        } else if !word.is_empty() {
            break;
        }
        if word.len() > WORD_LIMIT {
            let what = format!("a word of the data is longer than {WORD_LIMIT} bytes");
            return Fault::damaged(what);
        }
    }
    let word = String::from_utf8_lossy(&word).into_owned();
    Ok(Some(word).filter(|word| !word.is_empty()))
}
