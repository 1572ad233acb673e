//! The fields of a record as cells: numbers and words by name, those of records within it among them.

use crate::axes::Value;
use crate::data::Word;
use serde::Serialize;
use serde::ser::{Error as _, Impossible, SerializeStruct, Serializer};
use std::borrow::Cow;
use std::fmt;

/// A field of a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Its name, as the store has it. A record within the record only lends its fields: `counters.stages` is `stages`, and
    /// `NAME_so_far` where the record has a field of that name itself. One within that has its name before: `stress.shear.repulsion` is
    /// `shear_repulsion`.
    pub name: Word,
    /// What it holds.
    pub value: Value,
}

/// Something in a record that is neither a number nor a word.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("a record cannot be a row of a table: {0}")]
pub struct Unfit(String);

impl serde::ser::Error for Unfit {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self(message.to_string())
    }
}

/// The fields of a record, in their order; so new ones are there by themselves.
///
/// # Errors
/// [`Unfit`] if one is neither a number, a word, nor a record of such.
pub fn fields(record: &impl Serialize) -> Result<Vec<Field>, Unfit> {
    let mut all = Vec::with_capacity(64);
    record.serialize(Reader {
        path: Path::default(),
        all: &mut all,
    })?;
    Ok(all)
}

/// Names of a field and of the records it is in, the outermost first.
#[derive(Clone, Copy, Default)]
struct Path {
    names: [&'static str; 4],
    depth: usize,
}

impl Path {
    /// The path of a field of this record.
    fn of_field(mut self, name: &'static str) -> Result<Self, Unfit> {
        let place = self.names.get_mut(self.depth);
        *place.ok_or_else(|| no("a record four deep"))? = name;
        self.depth += 1;
        Ok(self)
    }
}

/// Reads the record, or a field of it.
struct Reader<'f> {
    path: Path,
    all: &'f mut Vec<Field>,
}

impl Reader<'_> {
    /// Takes what the field holds.
    fn take(self, value: Value) -> Result<(), Unfit> {
        let name: Word = match &self.path.names[..self.path.depth] {
            [] => return Err(no("a value without a name")),
            [name] | [_, name] => Cow::Borrowed(*name),
            [_, names @ ..] => names.join("_").into(),
        };
        let taken = self.all.iter().any(|field| field.name == name);
        self.all.push(Field {
            name: if taken {
                format!("{name}_so_far").into()
            } else {
                name
            },
            value,
        });
        Ok(())
    }
}

/// The error about a thing that is no cell.
fn no(thing: &str) -> Unfit {
    Unfit::custom(thing)
}

impl SerializeStruct for Reader<'_> {
    type Ok = ();
    type Error = Unfit;

    fn serialize_field<T: ?Sized + Serialize>(
        &mut self,
        key: &'static str,
        value: &T,
    ) -> Result<(), Unfit> {
        value.serialize(Reader {
            path: self.path.of_field(key)?,
            all: self.all,
        })
    }

    fn end(self) -> Result<(), Unfit> {
        Ok(())
    }
}

impl<'f> Serializer for Reader<'f> {
    type Ok = ();
    type Error = Unfit;
    type SerializeSeq = Impossible<(), Unfit>;
    type SerializeTuple = Impossible<(), Unfit>;
    type SerializeTupleStruct = Impossible<(), Unfit>;
    type SerializeTupleVariant = Impossible<(), Unfit>;
    type SerializeMap = Impossible<(), Unfit>;
    type SerializeStruct = Reader<'f>;
    type SerializeStructVariant = Impossible<(), Unfit>;

    fn serialize_bool(self, v: bool) -> Result<(), Unfit> {
        self.take(Value::Count(v.into()))
    }

    fn serialize_i8(self, v: i8) -> Result<(), Unfit> {
        self.serialize_i64(v.into())
    }

    fn serialize_i16(self, v: i16) -> Result<(), Unfit> {
        self.serialize_i64(v.into())
    }

    fn serialize_i32(self, v: i32) -> Result<(), Unfit> {
        self.serialize_i64(v.into())
    }

    fn serialize_i64(self, v: i64) -> Result<(), Unfit> {
        let count = u64::try_from(v).map_err(|_| no("a negative whole number"))?;
        self.take(Value::Count(count))
    }

    fn serialize_u8(self, v: u8) -> Result<(), Unfit> {
        self.take(Value::Count(v.into()))
    }

    fn serialize_u16(self, v: u16) -> Result<(), Unfit> {
        self.take(Value::Count(v.into()))
    }

    fn serialize_u32(self, v: u32) -> Result<(), Unfit> {
        self.take(Value::Count(v.into()))
    }

    fn serialize_u64(self, v: u64) -> Result<(), Unfit> {
        self.take(Value::Count(v))
    }

    fn serialize_f32(self, v: f32) -> Result<(), Unfit> {
        self.take(Value::Number(v.into()))
    }

    fn serialize_f64(self, v: f64) -> Result<(), Unfit> {
        self.take(Value::Number(v))
    }

    fn serialize_char(self, _: char) -> Result<(), Unfit> {
        Err(no("a character"))
    }

    fn serialize_str(self, _: &str) -> Result<(), Unfit> {
        Err(no("a text"))
    }

    fn serialize_bytes(self, _: &[u8]) -> Result<(), Unfit> {
        Err(no("bytes"))
    }

    fn serialize_none(self) -> Result<(), Unfit> {
        self.take(Value::Number(f64::NAN))
    }

    fn serialize_some<T: ?Sized + Serialize>(self, value: &T) -> Result<(), Unfit> {
        value.serialize(self)
    }

    fn serialize_unit(self) -> Result<(), Unfit> {
        Err(no("a unit"))
    }

    fn serialize_unit_struct(self, name: &'static str) -> Result<(), Unfit> {
        Err(no(name))
    }

    fn serialize_unit_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
    ) -> Result<(), Unfit> {
        self.take(Value::Word(variant))
    }

    fn serialize_newtype_struct<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        value: &T,
    ) -> Result<(), Unfit> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: ?Sized + Serialize>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: &T,
    ) -> Result<(), Unfit> {
        Err(no(variant))
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<Self::SerializeSeq, Unfit> {
        Err(no("a list"))
    }

    fn serialize_tuple(self, _: usize) -> Result<Self::SerializeTuple, Unfit> {
        Err(no("several values in one field"))
    }

    fn serialize_tuple_struct(
        self,
        name: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleStruct, Unfit> {
        Err(no(name))
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self::SerializeTupleVariant, Unfit> {
        Err(no(variant))
    }

    fn serialize_map(self, _: Option<usize>) -> Result<Self::SerializeMap, Unfit> {
        Err(no("a map"))
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self::SerializeStruct, Unfit> {
        Ok(self)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self::SerializeStructVariant, Unfit> {
        Err(no(variant))
    }
}
