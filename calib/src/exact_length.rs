//! Deserialisation in which a sequence has exactly the elements that are asked for.
//!
//! A format may hand over the first elements of an array and drop the rest without an error, as the `toml` crate does
//! for `[f64; 5]`. [`ExactLength`] wraps its deserialiser, and every one nested in it: an array with elements left over is
//! an error that names the number of them.

use std::fmt;

use serde::de::{
    DeserializeSeed, Deserializer, EnumAccess, Error, IgnoredAny, MapAccess, SeqAccess, VariantAccess,
    Visitor,
};

/// Wrapper around a deserialiser, a visitor, a seed or an access of `serde`.
pub(crate) struct ExactLength<T>(pub(crate) T);

macro_rules! forward {
    ($($method:ident($($argument:ident: $type:ty),*);)*) => {
        $(fn $method<V: Visitor<'de>>(self, $($argument: $type,)* visitor: V) -> Result<V::Value, D::Error> {
            self.0.$method($($argument,)* ExactLength(visitor))
        })*
    };
}

impl<'de, D: Deserializer<'de>> Deserializer<'de> for ExactLength<D> {
    type Error = D::Error;

    forward! {
        deserialize_any(); deserialize_bool(); deserialize_i8(); deserialize_i16(); deserialize_i32(); deserialize_i64();
        deserialize_i128(); deserialize_u8(); deserialize_u16(); deserialize_u32(); deserialize_u64(); deserialize_u128();
        deserialize_f32(); deserialize_f64(); deserialize_char(); deserialize_str(); deserialize_string();
        deserialize_bytes(); deserialize_byte_buf(); deserialize_option(); deserialize_unit(); deserialize_seq();
        deserialize_map(); deserialize_identifier(); deserialize_ignored_any();
        deserialize_unit_struct(name: &'static str);
        deserialize_newtype_struct(name: &'static str);
        deserialize_tuple(length: usize);
        deserialize_tuple_struct(name: &'static str, length: usize);
        deserialize_struct(name: &'static str, fields: &'static [&'static str]);
        deserialize_enum(name: &'static str, variants: &'static [&'static str]);
    }

    fn is_human_readable(&self) -> bool {
        self.0.is_human_readable()
    }
}

macro_rules! visit {
    ($($method:ident($type:ty);)*) => {
        $(fn $method<E: Error>(self, value: $type) -> Result<V::Value, E> {
            self.0.$method(value)
        })*
    };
}

impl<'de, V: Visitor<'de>> Visitor<'de> for ExactLength<V> {
    type Value = V::Value;

    visit! {
        visit_bool(bool); visit_i8(i8); visit_i16(i16); visit_i32(i32); visit_i64(i64); visit_i128(i128); visit_u8(u8);
        visit_u16(u16); visit_u32(u32); visit_u64(u64); visit_u128(u128); visit_f32(f32); visit_f64(f64);
        visit_char(char); visit_str(&str); visit_borrowed_str(&'de str); visit_string(String); visit_bytes(&[u8]);
        visit_borrowed_bytes(&'de [u8]); visit_byte_buf(Vec<u8>);
    }

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.expecting(formatter)
    }

    fn visit_none<E: Error>(self) -> Result<V::Value, E> {
        self.0.visit_none()
    }

    fn visit_unit<E: Error>(self) -> Result<V::Value, E> {
        self.0.visit_unit()
    }

    fn visit_some<D: Deserializer<'de>>(self, value: D) -> Result<V::Value, D::Error> {
        self.0.visit_some(ExactLength(value))
    }

    fn visit_newtype_struct<D: Deserializer<'de>>(self, value: D) -> Result<V::Value, D::Error> {
        self.0.visit_newtype_struct(ExactLength(value))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<V::Value, A::Error> {
        let mut taken = 0;
        let value = self.0.visit_seq(Counted { sequence: &mut sequence, taken: &mut taken })?;
        let mut left_over = 0;
        while sequence.next_element::<IgnoredAny>()?.is_some() {
            left_over += 1;
        }
        if left_over > 0 {
            let length = taken + left_over;
            return Err(A::Error::custom(format_args!(
                "invalid length {length}, expected an array of {taken}"
            )));
        }
        Ok(value)
    }

    fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<V::Value, A::Error> {
        self.0.visit_map(ExactLength(map))
    }

    fn visit_enum<A: EnumAccess<'de>>(self, data: A) -> Result<V::Value, A::Error> {
        self.0.visit_enum(ExactLength(data))
    }
}

impl<'de, S: DeserializeSeed<'de>> DeserializeSeed<'de> for ExactLength<S> {
    type Value = S::Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<S::Value, D::Error> {
        self.0.deserialize(ExactLength(deserializer))
    }
}

/// A sequence that counts the elements taken from it.
struct Counted<'a, A> {
    sequence: &'a mut A,
    taken: &'a mut usize,
}

impl<'de, A: SeqAccess<'de>> SeqAccess<'de> for Counted<'_, A> {
    type Error = A::Error;

    fn next_element_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<Option<T::Value>, A::Error> {
        let element = self.sequence.next_element_seed(ExactLength(seed))?;
        *self.taken += usize::from(element.is_some());
        Ok(element)
    }

    fn size_hint(&self) -> Option<usize> {
        self.sequence.size_hint()
    }
}

impl<'de, A: MapAccess<'de>> MapAccess<'de> for ExactLength<A> {
    type Error = A::Error;

    fn next_key_seed<K: DeserializeSeed<'de>>(&mut self, seed: K) -> Result<Option<K::Value>, A::Error> {
        self.0.next_key_seed(seed)
    }

    fn next_value_seed<T: DeserializeSeed<'de>>(&mut self, seed: T) -> Result<T::Value, A::Error> {
        self.0.next_value_seed(ExactLength(seed))
    }

    fn size_hint(&self) -> Option<usize> {
        self.0.size_hint()
    }
}

impl<'de, A: EnumAccess<'de>> EnumAccess<'de> for ExactLength<A> {
    type Error = A::Error;
    type Variant = ExactLength<A::Variant>;

    fn variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<(T::Value, Self::Variant), A::Error> {
        let (value, variant) = self.0.variant_seed(seed)?;
        Ok((value, ExactLength(variant)))
    }
}

impl<'de, A: VariantAccess<'de>> VariantAccess<'de> for ExactLength<A> {
    type Error = A::Error;

    fn unit_variant(self) -> Result<(), A::Error> {
        self.0.unit_variant()
    }

    fn newtype_variant_seed<T: DeserializeSeed<'de>>(self, seed: T) -> Result<T::Value, A::Error> {
        self.0.newtype_variant_seed(ExactLength(seed))
    }

    fn tuple_variant<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, A::Error> {
        self.0.tuple_variant(length, ExactLength(visitor))
    }

    fn struct_variant<V: Visitor<'de>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, A::Error> {
        self.0.struct_variant(fields, ExactLength(visitor))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, Deserialize, PartialEq)]
    #[serde(deny_unknown_fields)]
    struct Table {
        #[serde(default)]
        flat: [f64; 2],
        #[serde(default)]
        rows: [[f64; 2]; 2],
        #[serde(default)]
        any: Vec<[i64; 2]>,
        maybe: Option<[u8; 1]>,
        #[serde(default)]
        kind: Kind,
        #[serde(default)]
        place: Option<nalgebra::Point2<f64>>,
    }

    #[derive(Debug, Default, Deserialize, PartialEq)]
    #[serde(rename_all = "lowercase")]
    enum Kind {
        #[default]
        Plain,
        Pair(i64, i64),
        Named {
            at: [i64; 2],
        },
    }

    fn read(text: &str) -> Result<Table, toml::de::Error> {
        Table::deserialize(ExactLength(toml::Deserializer::parse(text)?))
    }

    #[test]
    fn arrays_of_the_right_length_are_read_as_before() {
        for text in [
            "flat = [1, 2.5]\nrows = [[1, 2], [3, 4]]\nany = [[1, 2], [3, 4], [5, 6]]\nmaybe = [7]\nkind = \"plain\"",
            "any = []\nkind = { pair = [1, 2] }\nplace = [1.5, 2.0]",
            "kind = { named = { at = [1, 2] } }",
        ] {
            assert_eq!(read(text).unwrap(), toml::from_str(text).unwrap());
        }
    }

    #[test]
    fn an_array_with_elements_left_over_is_refused_at_any_depth() {
        for (text, length) in [
            ("flat = [1, 2, 3]", "invalid length 3, expected an array of 2"),
            ("rows = [[1, 2], [3, 4, 5, 6]]", "invalid length 4, expected an array of 2"),
            ("rows = [[1, 2], [3, 4], [5, 6]]", "invalid length 3, expected an array of 2"),
            ("any = [[1, 2], [3, 4, 5]]", "invalid length 3, expected an array of 2"),
            ("maybe = [1, 2]", "invalid length 2, expected an array of 1"),
            ("kind = { named = { at = [1, 2, 3] } }", "invalid length 3, expected an array of 2"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.message().contains(length) && error.span().is_some(), "{text}: {error}");
        }
        // nalgebra's points check their length themselves.
        assert!(read("place = [1, 2, 3]").is_err());
        assert!(read("flat = [1]").unwrap_err().message().contains("invalid length 1"));
    }
}
