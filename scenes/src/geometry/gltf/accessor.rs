//! Numbers of a glTF file: accessors of views of buffers, none of which is believed to lie where it says.

use super::document::Accessor;
use super::read::{File, Parsed, named};

impl File<'_> {
    /// Bytes of a view, and the distance of its elements where it states one.
    pub(super) fn view(&self, index: usize) -> Parsed<(&[u8], Option<usize>)> {
        let view = named(&self.document.buffer_views, index, "bufferView")?;
        let place = || format!("bufferView {index}");
        if let Some(name) = view.extensions.keys().find(|name| name.contains("meshopt")) {
            return Err((
                place(),
                format!("it is compressed by {name}, which is not read; export it without"),
            ));
        }
        let buffer = named(&self.buffers, view.buffer, "buffer")?;
        let bytes = buffer.get(view.byte_offset..).and_then(|rest| rest.get(..view.byte_length));
        let bytes =
            bytes.ok_or_else(|| (place(), "it goes beyond its buffer; export the file again".to_owned()))?;
        Ok((bytes, view.byte_stride))
    }

    /// The elements of an accessor: their bytes, one after the other.
    fn elements(&self, index: usize, accessor: &Accessor, size: usize) -> Parsed<Vec<&[u8]>> {
        let wrong = |problem: &str| (format!("accessor {index}"), problem.to_owned());
        if accessor.sparse.is_some() {
            return Err(wrong("it is sparse, which is not read; export the file without"));
        }
        let view = accessor
            .buffer_view
            .ok_or_else(|| wrong("it has no bufferView; export the file without compression"))?;
        let (bytes, stride) = self.view(view)?;
        let stride = stride.unwrap_or(size).max(size);
        let bytes = bytes.get(accessor.byte_offset..).unwrap_or_default();
        let needed =
            accessor.count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(size));
        if needed.is_none_or(|needed| needed > bytes.len()) {
            return Err(wrong("it goes beyond its bufferView; export the file again"));
        }
        Ok((0..accessor.count).map(|i| &bytes[i * stride..i * stride + size]).collect())
    }

    /// Elements of `N` numbers; whole numbers that are normalised become 0 to 1 or −1 to 1.
    pub(super) fn numbers<const N: usize>(&self, index: usize, shape: &str) -> Parsed<Vec<[f64; N]>> {
        let accessor = named(&self.document.accessors, index, "accessor")?;
        if accessor.shape != shape {
            return Err((
                format!("accessor {index}"),
                format!("its type is {}, not {shape}", accessor.shape),
            ));
        }
        let component = Component::of(index, accessor)?;
        let elements = self.elements(index, accessor, N * component.size())?;
        let number = |bytes: &[u8]| component.number(bytes, accessor.normalized);
        Ok(elements
            .into_iter()
            .map(|bytes| std::array::from_fn(|c| number(&bytes[c * component.size()..])))
            .collect())
    }

    pub(super) fn indices(&self, index: usize) -> Parsed<Vec<usize>> {
        let accessor = named(&self.document.accessors, index, "accessor")?;
        let component = Component::of(index, accessor)?;
        if accessor.shape != "SCALAR" || !matches!(component, Component::U8 | Component::U16 | Component::U32)
        {
            return Err((format!("accessor {index}"), "indices are whole numbers without a sign".into()));
        }
        let elements = self.elements(index, accessor, component.size())?;
        Ok(elements.into_iter().map(|bytes| component.number(bytes, false) as usize).collect())
    }
}

/// Type of an accessor's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn of(index: usize, accessor: &Accessor) -> Parsed<Self> {
        Ok(match accessor.component_type {
            5120 => Self::I8,
            5121 => Self::U8,
            5122 => Self::I16,
            5123 => Self::U16,
            5125 => Self::U32,
            5126 => Self::F32,
            other => {
                return Err((
                    format!("accessor {index}"),
                    format!("the componentType {other} is none of glTF's"),
                ));
            }
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// Number at the beginning of some bytes, of which there are enough.
    fn number(self, bytes: &[u8], is_normalized: bool) -> f64 {
        let two = || [bytes[0], bytes[1]];
        let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
        let (value, full) = match self {
            Self::I8 => (f64::from(bytes[0] as i8), 127.0),
            Self::U8 => (f64::from(bytes[0]), 255.0),
            Self::I16 => (f64::from(i16::from_le_bytes(two())), 32_767.0),
            Self::U16 => (f64::from(u16::from_le_bytes(two())), 65_535.0),
            Self::U32 => (f64::from(u32::from_le_bytes(four())), 1.0),
            Self::F32 => (f64::from(f32::from_le_bytes(four())), 1.0),
        };
        if is_normalized { (value / full).max(-1.0) } else { value }
    }
}
