//! A model with a variable of every type.

use fmu_export::*;

enumeration! {
    /// A colour.
    pub enum Colour {
        /// Like the sky
        Blue = -3,
        /// Like blood
        Red = 5,
    }
}

/// Stores the values that are set and calculates nothing.
#[derive(Clone, Default)]
pub struct Palette {
    float64: f64,
    float32: f32,
    int8: i8,
    uint8: u8,
    int16: i16,
    uint16: u16,
    int32: i32,
    uint32: u32,
    int64: i64,
    uint64: u64,
    boolean: bool,
    string: String,
    binary: Vec<u8>,
    colour: Option<Colour>,
    shade: f32,
}

const SMALL: Type = Type::float32("Small", &units::ONE).max(8.0);
const INT8: Type = Type::whole("", BaseType::Int8);
const UINT8: Type = Type::whole("", BaseType::UInt8);
const INT16: Type = Type::whole("", BaseType::Int16);
const UINT16: Type = Type::whole("Port", BaseType::UInt16).min_integer(1024);
const UINT32: Type = Type::whole("", BaseType::UInt32);
const INT64: Type = Type::whole("", BaseType::Int64);
const UINT64: Type = Type::whole("", BaseType::UInt64);
const PICTURE: Type = Type::binary("Picture", "image/png").max_size(16);
const COLOUR: Type = Type::enumeration("Colour", <Colour as Enumeration>::ITEMS);

variables! { for Palette;
    /// Float64
    float64 = input(&NUMBER) in float64;
    /// Float32
    float32 = input(&SMALL) in float32;
    /// Int8
    int8 = input(&INT8) in int8;
    /// UInt8
    uint8 = input(&UINT8) in uint8;
    /// Int16
    int16 = input(&INT16) in int16;
    /// UInt16
    uint16 = parameter(&UINT16).tunable() in uint16;
    /// Int32
    int32 = input(&INTEGER) in int32;
    /// UInt32
    uint32 = input(&UINT32) in uint32;
    /// Int64
    int64 = input(&INT64) in int64;
    /// UInt64
    uint64 = input(&UINT64) in uint64;
    /// Boolean
    boolean = input(&BOOLEAN) in boolean;
    /// String
    string = input(&STRING) in string;
    /// Binary
    binary = input(&PICTURE) in binary;
    /// Enumeration
    colour = output(&COLOUR) by |palette| palette.colour.unwrap_or(Colour::Red);
    /// Float32 parameter with a maximum
    shade = parameter(&SMALL) in shade;
}

impl Model for Palette {
    const INFO: Info = info!("Palette", "palette");

    fn new(_: &Setup) -> Result<Self, Error> {
        Ok(Self { uint16: 8080, ..Self::default() })
    }
}

impl CoSimulation for Palette {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Palette {}

offer!(Palette: CoSimulation + ModelExchange);
