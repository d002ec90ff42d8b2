//! A model with a variable of every type, also of one that an author defines, and with an array of binary values.

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

/// A temperature in a type that the author of a model may define, with only the required functions.
#[derive(Clone, Copy)]
pub struct Celsius(pub f64);

impl Saved for Celsius {
    fn visit(&mut self, visitor: &mut dyn StateVisitor) {
        self.0.visit(visitor);
    }
}

impl Scalar for Celsius {
    const BASE: BaseType = BaseType::Real;

    fn value(&self) -> Value {
        Value::Real(self.0)
    }

    fn assign(&mut self, value: &Value) {
        if let Value::Real(value) = value {
            self.0 = *value;
        }
    }
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

variables! {
    /// Stores the values that are set.
    pub struct Palette;
    /// Float64
    float64: f64 = input(&NUMBER);
    /// Float32
    float32: f32 = input(&SMALL);
    /// Int8
    int8: i8 = input(&INT8);
    /// UInt8
    uint8: u8 = input(&UINT8);
    /// Int16
    int16: i16 = input(&INT16);
    /// UInt16
    uint16: u16 = parameter(&UINT16).tunable().start(8080);
    /// Int32
    int32: i32 = input(&INTEGER);
    /// UInt32
    uint32: u32 = input(&UINT32);
    /// Int64
    int64: i64 = input(&INT64);
    /// UInt64
    uint64: u64 = input(&UINT64);
    /// Boolean
    boolean: bool = input(&BOOLEAN);
    /// String
    string: String = input(&STRING);
    /// Binary
    binary: Vec<u8> = input(&PICTURE);
    /// Enumeration
    colour = output(&COLOUR) by |_| Colour::Red;
    /// Float32 parameter with a maximum
    shade: f32 = parameter(&SMALL);
    /// Twice the Float32
    twice = output(&SMALL) by |palette| 2.0 * palette.float32;
    /// Temperature in a type of the author
    celsius: Celsius = input(&NUMBER).start(Celsius(20.0));
    /// Two binary values
    pair: [Vec<u8>; 2] = input(&BINARY);
}

impl Model for Palette {
    const INFO: Info = info!("Palette", "palette");
}

impl CoSimulation for Palette {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Palette {}

offer!(Palette: CoSimulation + ModelExchange);
