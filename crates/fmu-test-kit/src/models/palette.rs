//! A model with a variable of every type, also of one that an author defines, with an array of binary values, and with a state
//! that is the derivative of another state.

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
const SINGLE: Type = Type::float32("Single", &units::ONE).max(0.1);
const INT8: Type = Type::whole("", BaseType::Int8);
const UINT8: Type = Type::whole("Byte", BaseType::UInt8).max_integer(200);
const INT16: Type = Type::whole("", BaseType::Int16);
const UINT16: Type = Type::whole("Port", BaseType::UInt16).min_integer(1024);
const UINT32: Type = Type::whole("", BaseType::UInt32);
const INT64: Type = Type::whole("", BaseType::Int64);
const UINT64: Type = Type::whole("Huge", BaseType::UInt64).min_integer(1);
const PICTURE: Type = Type::binary("Picture", "image/png").max_size(16);
const COLOUR: Type = Type::enumeration("Colour", <Colour as Enumeration>::ITEMS);

variables! {
    /// Stores the values that are set, and swings.
    pub struct Palette;
    /// Float64
    float64: f64 = input(&NUMBER);
    /// Float32
    float32: f32 = input(&SINGLE).start(0.1);
    /// Int8
    int8: i8 = input(&INT8).start(-128);
    /// UInt8
    uint8: u8 = input(&UINT8).start(3);
    /// Int16
    int16: i16 = input(&INT16).start(-5);
    /// UInt16
    uint16: u16 = parameter(&UINT16).tunable().start(8080);
    /// Int32
    int32: i32 = input(&INTEGER);
    /// UInt32
    uint32: u32 = input(&UINT32).start(4_000_000_000);
    /// Int64
    int64: i64 = input(&INT64).start(i64::MIN);
    /// UInt64
    uint64: u64 = input(&UINT64).start(u64::MAX);
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
    twice = output(&SINGLE) by |palette| 2.0 * palette.float32;
    /// Temperature in a type of the author
    celsius: Celsius = input(&NUMBER).start(Celsius(20.0));
    /// Angle
    angle: f64 = local(&NUMBER).state().start(1.0);
    /// Its derivative, which is also a state
    speed: f64 = output(&NUMBER).state().derivative_of(angle);
    /// The derivative of the speed
    acceleration = local(&NUMBER).derivative_of(speed) by |palette| -palette.angle;
    /// Two binary values
    pair: [Vec<u8>; 2] = input(&PICTURE).start([vec![0, 0xAB], Vec::new()]);
}

impl Model for Palette {
    const INFO: Info = Info::new("Palette", "palette");
}

impl CoSimulation for Palette {
    fn step(&mut self, step: Step) -> Result<Stepped, Error> {
        let (sine, cosine) = step.size.sin_cos();
        (self.angle, self.speed) =
            (cosine * self.angle + sine * self.speed, cosine * self.speed - sine * self.angle);
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Palette {}

offer!(Palette: CoSimulation + ModelExchange);
