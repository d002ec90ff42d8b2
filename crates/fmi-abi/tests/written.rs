//! Descriptions that are written are the same when they are read.
#![cfg(all(feature = "calls", feature = "description", feature = "write"))]

use fmi_abi::calls::Random;
use fmi_abi::description::{
    About, Alias, Attributes, Clock, Item, LogCategory, ModelDescription, Offer, Timing, Type, Unknown,
    Variable,
};
use fmi_abi::{
    BaseType, BaseUnit, Causality, DependencyKind, DisplayUnit, Initial, IntervalVariability, Standard, Unit,
    Value, Variability,
};
use std::path::Path;
use std::sync::Arc;

/// Draws descriptions. Names have characters that XML escapes.
struct Draw {
    random: Random,
    standard: Standard,
    names: usize,
}

impl Draw {
    fn some<T>(&mut self, draw: impl FnOnce(&mut Self) -> T) -> Option<T> {
        self.random.chance(0.5).then(|| draw(self))
    }

    fn list<T>(&mut self, most: usize, mut draw: impl FnMut(&mut Self) -> T) -> Vec<T> {
        (0..self.random.below(most + 1)).map(|_| draw(self)).collect()
    }

    fn one<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.random.below(all.len())]
    }

    fn name(&mut self) -> String {
        self.names += 1;
        format!("{}{}", self.one(&["x", "a b", "<&\"'>", "a\t\r\n", "\u{e9}\u{4e2d}"]), self.names)
    }

    /// Returns a text that may be missing.
    fn text(&mut self) -> String {
        self.some(Self::name).unwrap_or_default()
    }

    fn number(&mut self) -> f64 {
        loop {
            let number = f64::from_bits(self.random.bits());
            if number.is_finite() {
                return number;
            }
        }
    }

    fn base(&mut self) -> BaseType {
        let standard = self.standard;
        let known: Vec<_> =
            BaseType::ALL.into_iter().filter(|base| base.element(standard).is_some()).collect();
        self.one(&known)
    }

    fn value(&mut self, base: BaseType) -> Value {
        match base {
            BaseType::Real => Value::Real(self.number()),
            BaseType::Float32 => Value::Real(f64::from(self.number() as f32)),
            BaseType::Boolean => Value::Boolean(self.random.chance(0.5)),
            BaseType::String => Value::String(self.text()),
            BaseType::Binary => Value::Binary(self.list(3, |draw| draw.random.bits() as u8)),
            _ => {
                let (min, max) = base.range().unwrap_or((i64::MIN.into(), i64::MAX.into()));
                Value::Integer((self.random.bits() as i128 * if min < 0 { -1 } else { 1 }).clamp(min, max))
            }
        }
    }

    fn attributes(&mut self, base: BaseType) -> Attributes {
        let text = |draw: &mut Self| draw.some(|draw| Arc::from(draw.name()));
        let is_number = !matches!(base, BaseType::Boolean | BaseType::String | BaseType::Binary);
        let limit = |draw: &mut Self| draw.some(|draw| draw.value(base)).filter(|_| is_number);
        Attributes {
            quantity: text(self),
            unit: text(self).filter(|_| base.is_float()),
            display_unit: text(self).filter(|_| base.is_float()),
            is_relative: base.is_float() && self.random.chance(0.5),
            min: limit(self),
            max: limit(self),
            nominal: self.some(Self::number).filter(|_| base.is_float()),
            mime_type: text(self).filter(|_| base == BaseType::Binary),
            max_size: self.some(|draw| draw.random.bits()).filter(|_| base == BaseType::Binary),
        }
    }

    fn declared(&mut self) -> Type {
        let base = self.base();
        let mut value = 0;
        let items = self.list(3, |draw| {
            value += 1;
            Item { name: draw.name(), value, description: draw.text() }
        });
        Type {
            base: Some(base),
            attributes: self.attributes(base),
            items: if base == BaseType::Enumeration { items } else { Vec::new() },
            description: self.text(),
        }
    }

    fn unit(&mut self) -> Unit {
        let exponents = std::array::from_fn(|_| self.random.below(7) as i32 - 3);
        let base = |draw: &mut Self| BaseUnit { exponents, factor: draw.number(), offset: draw.number() };
        let display = |draw: &mut Self| DisplayUnit {
            name: draw.name(),
            factor: draw.number(),
            offset: draw.some(Self::number).unwrap_or(0.0),
        };
        Unit { base: self.some(base), display_units: self.list(2, display) }
    }

    fn offer(&mut self) -> Offer {
        let identifier = format!("m{}", self.random.below(9));
        let all = ["canGetAndSetFMUstate", "canSerializeFMUState", "hasEventMode", "needsExecutionTool"];
        let flags: Vec<_> = all
            .into_iter()
            .filter_map(|name| Some((name, self.some(|draw| draw.random.chance(0.5))?)))
            .collect();
        let mut offer = Offer::new(self.standard, identifier, &flags);
        offer.max_output_derivative_order = self.some(|draw| draw.random.below(9) as u32);
        if self.standard == Standard::Fmi2 {
            offer.source_files = self.list(2, Self::name);
        }
        offer
    }

    fn clock(&mut self) -> Clock {
        use IntervalVariability::{Changing, Constant, Countdown, Fixed, Triggered, Tunable};
        let supports_fraction = self.random.chance(0.5);
        let timing = self.some(|draw| match supports_fraction {
            true => Timing::Fraction {
                interval: draw.random.bits(),
                shift: draw.random.bits(),
                resolution: draw.random.bits(),
            },
            false => Timing::Decimal { interval: draw.number(), shift: draw.number() },
        });
        let all = [Constant, Fixed, Tunable, Changing, Countdown, Triggered];
        Clock { interval_variability: Some(self.one(&all)), timing, supports_fraction }
    }

    /// Returns a variable without a derivative. A fifth of those of FMI 3.0 are clocks.
    fn variable(&mut self, number: usize, types: &[(String, Type)]) -> Variable {
        let is_clock = self.standard == Standard::Fmi3 && self.random.chance(0.2);
        let declared = self.some(|draw| draw.random.below(types.len().max(1)));
        let declared = declared.and_then(|index| types.get(index)).filter(|_| !is_clock);
        let base = declared.map_or_else(|| self.base(), |(_, of)| of.base.unwrap());
        // A variable has what its declared type has, unless it has its own.
        let own = self.attributes(base);
        let of_type = declared.map(|(_, of)| of.attributes.clone()).unwrap_or_default();
        let attributes = Attributes {
            quantity: own.quantity.or(of_type.quantity),
            unit: own.unit.or(of_type.unit),
            display_unit: own.display_unit.or(of_type.display_unit),
            is_relative: own.is_relative || of_type.is_relative,
            min: own.min.or(of_type.min),
            max: own.max.or(of_type.max),
            nominal: own.nominal.or(of_type.nominal),
            mime_type: own.mime_type.or(of_type.mime_type),
            max_size: own.max_size.or(of_type.max_size),
        };
        let can_be_array = self.standard == Standard::Fmi3 && !is_clock;
        let dimensions = self.list(2, |draw| draw.random.below(3) + 1);
        let dimensions = if can_be_array { dimensions } else { Vec::new() };
        let size = dimensions.iter().product();
        let start = self.some(|draw| (0..size).map(|_| draw.value(base).to_string()).collect());
        let causality =
            self.one(&[Causality::Input, Causality::Output, Causality::Local, Causality::Parameter]);
        let variability = self.one(&[
            Variability::Discrete,
            Variability::Tunable,
            Variability::Fixed,
            Variability::Continuous,
        ]);
        let clocks = self.list(2, |draw| draw.random.below(9) as u32);
        let clocked = can_be_array && self.random.chance(0.3);
        let alias = |draw: &mut Self| Alias {
            name: draw.name(),
            display_unit: draw.some(|draw| Arc::from(draw.name())),
            description: draw.text(),
        };
        let aliases = self.list(2, alias);
        let is_fmi3 = self.standard == Standard::Fmi3;
        Variable {
            name: self.name(),
            reference: 3 * number as u32 + 1,
            base: (!is_clock).then_some(base),
            causality,
            variability,
            has_variability: true,
            initial: match causality {
                Causality::Input => None,
                _ => Some(self.one(&[Initial::Exact, Initial::Approx, Initial::Calculated])),
            },
            start: if is_clock { Vec::new() } else { start.unwrap_or_default() },
            dimensions: Some(dimensions),
            size: Some(size),
            is_too_large: false,
            attributes: if is_clock { Attributes::default() } else { attributes },
            declared_type: declared.map(|(name, _)| name.clone()),
            derivative_of: None,
            reinit: base == BaseType::Real && !is_clock && self.random.chance(0.2),
            clocked,
            clocks: if clocked { clocks } else { Vec::new() },
            once_per_instant: is_fmi3 && self.random.chance(0.2),
            clock: is_clock.then(|| Box::new(self.clock())),
            description: self.text(),
            aliases: if is_fmi3 { aliases } else { Vec::new() },
        }
    }

    /// Returns unknowns, each another variable of those that are `possible`.
    fn unknowns(&mut self, possible: &[usize], count: usize) -> Vec<Unknown> {
        let chosen: Vec<_> = possible.iter().copied().filter(|_| self.random.chance(0.4)).collect();
        let unknown = |variable| {
            let dependencies = self.some(|draw| draw.list(3, |draw| draw.random.below(count)));
            let kinds = [DependencyKind::Dependent, DependencyKind::Constant, DependencyKind::Fixed];
            let length = dependencies.as_ref().map_or(0, Vec::len);
            let kinds = self.some(|draw| (0..length).map(|_| draw.one(&kinds)).collect());
            Unknown { variable, dependencies, kinds: kinds.unwrap_or_default() }
        };
        chosen.into_iter().map(unknown).collect()
    }

    fn description(&mut self) -> ModelDescription {
        let types = self.list(4, |draw| (draw.name(), draw.declared()));
        let count = self.random.below(8) + 1;
        let mut variables: Vec<_> = (0..count).map(|number| self.variable(number, &types)).collect();
        for (index, variable) in variables.iter_mut().enumerate() {
            let other = self.some(|draw| draw.random.below(count)).filter(|other| *other != index);
            variable.derivative_of = other.filter(|_| variable.base.is_some());
        }
        let is_fmi3 = self.standard == Standard::Fmi3;
        let all: Vec<usize> = (0..count).collect();
        let is_continuous = |of: &Variable| of.is_float() && of.variability == Variability::Continuous;
        let continuous: Vec<_> =
            all.iter().copied().filter(|index| is_continuous(&variables[*index])).collect();
        let indicators = if is_fmi3 { self.unknowns(&continuous, count) } else { Vec::new() };
        let elements = indicators.iter().map(|of| variables[of.variable].size.unwrap()).sum();
        let category = |draw: &mut Self| LogCategory { name: draw.name(), description: draw.text() };
        ModelDescription {
            standard: self.standard,
            version: if is_fmi3 { "3.0" } else { "2.0" }.to_owned(),
            model_name: self.name(),
            token: self.name(),
            about: About {
                description: self.text(),
                author: self.text(),
                version: self.text(),
                copyright: self.text(),
                license: self.text(),
                generation_tool: self.text(),
            },
            co_simulation: self.some(Self::offer),
            model_exchange: self.some(Self::offer),
            scheduled_execution: self.some(Self::offer).filter(|_| is_fmi3),
            default_experiment: std::array::from_fn(|_| self.some(Self::number)),
            default_tolerance: self.some(Self::number).map(f64::abs).filter(|tolerance| *tolerance > 0.0),
            outputs: self.unknowns(&all, count),
            derivatives: self.unknowns(&all, count),
            initial_unknowns: self.unknowns(&all, count),
            event_indicators: Some(if is_fmi3 { elements } else { self.random.below(3) }),
            indicators,
            log_categories: self.list(2, category),
            units: self.list(3, |draw| (draw.name(), draw.unit())).into_iter().collect(),
            types: types.into_iter().collect(),
            structured_names: self.random.chance(0.5),
            variables,
            faults: Vec::new(),
        }
    }
}

#[test]
fn descriptions_are_read_as_they_are_written() {
    for standard in [Standard::Fmi2, Standard::Fmi3] {
        let mut draw = Draw { random: Random::mixed(1), standard, names: 0 };
        for _ in 0..300 {
            let written = draw.description();
            let text = written.to_xml().unwrap();
            let read = ModelDescription::parse(&text).unwrap();
            assert_eq!(read, written, "{text}");
            // Maps are equal in any order, so the order of the file is compared, too.
            assert_eq!(read.to_xml().unwrap(), text);
        }
    }
}

/// Descriptions of real models stay the same.
#[test]
fn descriptions_of_models_are_written_as_they_are_read() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut count = 0;
    for directory in
        ["modelDescription", "crates/fmu-test-kit/models", "examples/controller/modelDescription"]
    {
        for entry in std::fs::read_dir(root.join(directory)).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|extension| extension != "xml") {
                continue;
            }
            let Ok(read) = ModelDescription::parse(&std::fs::read_to_string(&path).unwrap()) else {
                continue;
            };
            if !read.faults.is_empty() {
                continue;
            }
            let text = read.to_xml().unwrap();
            assert_eq!(ModelDescription::parse(&text).unwrap(), read, "{}", path.display());
            count += 1;
        }
    }
    assert!(count >= 10, "only {count} descriptions were found");
}

#[test]
fn a_description_that_was_read_in_part_is_not_written() {
    let text = "<fmiModelDescription fmiVersion='2.0' modelName='m' guid='g'><CoSimulation modelIdentifier='m'/>\
        <ModelVariables><ScalarVariable name='x' valueReference='0'><Real min='low'/></ScalarVariable></ModelVariables></fmiModelDescription>";
    let why = ModelDescription::parse(text).unwrap().to_xml().unwrap_err();
    assert!(why.contains("min of Real is \"low\", not a number"), "{why}");

    // Types that are unknown, or that FMI 2.0 lacks.
    let text = "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='g'><CoSimulation modelIdentifier='m'/>\
        <TypeDefinitions><Float99Type name='T'/></TypeDefinitions></fmiModelDescription>";
    let mut description = ModelDescription::parse(text).unwrap();
    assert!(description.to_xml().unwrap_err().starts_with("T cannot be written"));
    description.types.clear();
    description.variables =
        vec![Variable::scalar("x", 0, BaseType::Float32, Causality::Local, Variability::Continuous)];
    description.to_xml().unwrap();
    description.standard = Standard::Fmi2;
    assert!(description.to_xml().unwrap_err().starts_with("x cannot be written"));
}
