//! The header of a PLY file: its format, elements and their properties.

/// Most properties of an element.
const MAX_PROPERTIES: usize = 256;

/// Contents of the header.
pub struct Header<'a> {
    pub format: Format,
    pub elements: Vec<Element>,
    /// Textures that comments name, with their lines.
    pub textures: Vec<(usize, String)>,
    /// Lines of the header.
    pub lines: usize,
    pub body: &'a [u8],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    Ascii,
    Little,
    Big,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
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
    fn parse(name: &str) -> Option<Self> {
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

    pub fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

#[derive(Clone, Debug)]
pub struct Property {
    pub name: String,
    pub kind: Scalar,
    /// Type of the count of a list.
    pub list: Option<Scalar>,
}

#[derive(Clone, Debug)]
pub struct Element {
    pub name: String,
    pub count: usize,
    pub properties: Vec<Property>,
}

pub fn header(bytes: &[u8]) -> Result<Header<'_>, String> {
    let mut rest = bytes;
    let mut number = 0;
    let mut line = || -> Result<(usize, String), String> {
        let end = rest
            .iter()
            .take(4096)
            .position(|&b| b == b'\n')
            .ok_or_else(|| "the header has no end".to_owned())?;
        let text = String::from_utf8_lossy(&rest[..end]).trim().to_owned();
        rest = &rest[end + 1..];
        number += 1;
        Ok((number, text))
    };
    let (_, magic) = line().map_err(|_| "not a PLY file".to_owned())?;
    if magic != "ply" {
        return Err("not a PLY file".to_owned());
    }
    let mut format = None;
    let mut textures = Vec::new();
    let mut elements: Vec<Element> = Vec::new();
    let lines = loop {
        let (number, text) = line()?;
        let bad = || format!("line {number}: \"{text}\" is not understood");
        let words: Vec<&str> = text.split_whitespace().collect();
        match words.as_slice() {
            ["format", kind, "1.0"] => {
                format = Some(match *kind {
                    "ascii" => Format::Ascii,
                    "binary_little_endian" => Format::Little,
                    "binary_big_endian" => Format::Big,
                    _ => return Err(bad()),
                });
            }
            ["comment", "TextureFile", ..] => {
                let name = text.split_once("TextureFile").map_or("", |t| t.1.trim());
                textures.push((number, name.to_owned()));
            }
            [] | ["comment" | "obj_info", ..] => {}
            ["element", name, count] => elements.push(Element {
                name: (*name).to_owned(),
                count: count.parse().map_err(|_| bad())?,
                properties: Vec::new(),
            }),
            ["property", rest @ ..] => {
                let (list, kind, name) = match *rest {
                    ["list", count, kind, name] => (
                        Some(Scalar::parse(count).ok_or_else(bad)?),
                        Scalar::parse(kind).ok_or_else(bad)?,
                        name,
                    ),
                    [kind, name] => (None, Scalar::parse(kind).ok_or_else(bad)?, name),
                    _ => return Err(bad()),
                };
                let element = elements.last_mut().ok_or_else(bad)?;
                if element.properties.len() >= MAX_PROPERTIES {
                    return Err(format!(
                        "line {number}: more than {MAX_PROPERTIES} properties"
                    ));
                }
                element.properties.push(Property {
                    name: name.to_owned(),
                    kind,
                    list,
                });
            }
            ["end_header"] => break number,
            _ => return Err(bad()),
        }
    };
    let format = format.ok_or_else(|| "the header names no format".to_owned())?;
    Ok(Header {
        format,
        elements,
        textures,
        lines,
        body: rest,
    })
}
