//! Reads inputs over time from a table (CSV), and values from an argument.

use anyhow::{Context, Result, bail, ensure};
use fmu_package::terminal::short;
use fmu_run::{BaseType, Description, Trajectory, Value, Variable, nearest};
use std::fs;
use std::path::Path;

/// Inputs over time. The runner interprets the times: a continuous input is interpolated linearly between two rows, any
/// other is held, and two rows with the same time make a jump.
pub struct Table {
    pub time: Vec<f64>,
    /// The columns. A column for an array has the names of all its elements, which all get the same values.
    inputs: Vec<(Vec<String>, Column)>,
}

/// The values of an input.
enum Column {
    Numbers(Vec<f64>),
    /// Values that an `f64` cannot hold: strings and 64-bit integers.
    Values(Vec<Value>),
}

impl Table {
    /// Reads a table with a column `time` and a column for each input that it sets.
    pub fn read(file: &Path, description: &Description) -> Result<Self> {
        let path = || short(file);
        let text = fs::read(file).with_context(path)?;
        let mut reader = csv::ReaderBuilder::new();
        reader.trim(csv::Trim::All).delimiter(delimiter(&text));
        let mut reader = reader.from_reader(&*text);
        let names: Vec<String> = reader.headers().with_context(path)?.iter().map(str::to_owned).collect();
        let columns = names
            .iter()
            .map(|name| match name.as_str() {
                "time" => Ok(None),
                name => named(description, name, "set").map(Some).with_context(path),
            })
            .collect::<Result<Vec<_>>>()?;
        for (index, name) in names.iter().enumerate() {
            ensure!(!names[..index].contains(name), "{} has two columns {name}", path());
        }
        ensure!(
            names.iter().any(|name| name == "time"),
            "{} has no column time, in s; its columns are {}",
            path(),
            names.join(", ")
        );
        let mut time = Vec::new();
        let mut inputs: Vec<_> = columns.iter().flatten().map(|found| Column::of(found[0])).collect();
        for record in reader.records() {
            let record = record.with_context(path)?;
            let line = record.position().map_or(0, csv::Position::line);
            let mut input = inputs.iter_mut();
            for ((field, name), found) in record.iter().zip(&names).zip(&columns) {
                let added = match found.as_ref().zip(found.as_ref().and_then(|_| input.next())) {
                    None => number(field).map(|value| time.push(value)),
                    Some((found, column)) => column.push(description, found[0], field),
                };
                added.with_context(|| format!("{}, line {line}: {name} cannot be {field:?}", path()))?;
            }
            if let [.., before, after] = time[..]
                && after < before
            {
                bail!(
                    "{}, line {line}: the time {after} follows {before}; times must not decrease, and two rows with the same \
                     time make a jump",
                    path()
                );
            }
        }
        ensure!(!time.is_empty(), "{} has no values", path());
        let names = |found: Vec<&Variable>| found.iter().map(|variable| variable.name.clone()).collect();
        Ok(Self { time, inputs: columns.into_iter().flatten().map(names).zip(inputs).collect() })
    }

    /// Returns the inputs for a run.
    pub fn trajectories(&self) -> Vec<(&str, Trajectory<'_>)> {
        let times = &self.time[..];
        let mut all = Vec::new();
        for (names, column) in &self.inputs {
            let trajectory = match column {
                Column::Numbers(values) => Trajectory::Sampled { times, values },
                Column::Values(values) => Trajectory::SampledValues { times, values },
            };
            all.extend(names.iter().map(|name| (name.as_str(), trajectory)));
        }
        all
    }
}

impl Column {
    fn of(variable: &Variable) -> Self {
        match is_exact(variable) {
            true => Self::Values(Vec::new()),
            false => Self::Numbers(Vec::new()),
        }
    }

    fn push(&mut self, description: &Description, variable: &Variable, field: &str) -> Result<()> {
        let value = value(description, variable, field)?;
        match (self, value) {
            (Self::Values(values), value) => values.push(value),
            (Self::Numbers(values), Value::Real(value)) => values.push(value),
            (Self::Numbers(_), value) => bail!("{value} is not a number"),
        }
        Ok(())
    }
}

/// Returns the separator of the columns: a semicolon or a tab if the first line has one and no comma, else a comma. Spreadsheets write
/// semicolons where the comma is the decimal mark.
fn delimiter(text: &[u8]) -> u8 {
    let first = text.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let count = |of: u8| first.iter().filter(|byte| **byte == of).count();
    [b';', b'\t'].into_iter().find(|separator| count(*separator) > 0 && count(b',') == 0).unwrap_or(b',')
}

/// Parses a value of a variable. The result is a [`Value::Real`] for numbers, items of enumerations and Booleans, but not for strings
/// and 64-bit integers.
pub fn value(description: &Description, variable: &Variable, text: &str) -> Result<Value> {
    match variable.base {
        BaseType::String => Ok(Value::from(text)),
        BaseType::Binary => bail!("bytes cannot be written here"),
        BaseType::Int64 | BaseType::UInt64 => {
            Ok(Value::Integer(text.parse().ok().context("it must be an integer")?))
        }
        BaseType::Boolean => match text.to_ascii_lowercase().as_str() {
            "true" | "1" => Ok(Value::Real(1.0)),
            "false" | "0" => Ok(Value::Real(0.0)),
            _ => bail!("it must be true or false"),
        },
        BaseType::Enumeration => {
            let items = description.items(variable).unwrap_or_default();
            // An item may be called like the value of another one, and names come first.
            let found = items
                .iter()
                .find(|item| item.name == text)
                .or_else(|| items.iter().find(|item| text.parse() == Ok(item.value)));
            let names = || items.iter().map(|item| item.name.as_str()).collect::<Vec<_>>().join(", ");
            let item = found.with_context(|| format!("it must be one of {}", names()))?;
            Ok(Value::Real(item.value as f64))
        }
        _ => {
            let value = number(text)?;
            ensure!(variable.base.is_float() || value.fract() == 0.0, "it must be an integer");
            Ok(Value::Real(value))
        }
    }
}

fn number(text: &str) -> Result<f64> {
    let value: Option<f64> = text.parse().ok();
    if value.is_none() && text.contains(',') && text.replace(',', ".").parse::<f64>().is_ok() {
        bail!("write numbers with a decimal point");
    }
    value.filter(|value| value.is_finite()).context("it must be a finite number")
}

/// Returns whether the variable has values that an `f64` cannot hold. The runner returns these values separately.
pub fn is_exact(variable: &Variable) -> bool {
    matches!(variable.base, BaseType::String | BaseType::Binary | BaseType::Int64 | BaseType::UInt64)
}

/// Returns the variable of this name, or all elements of the array of this name. `purpose` is a verb for the error message.
pub fn named<'a>(description: &'a Description, name: &str, purpose: &str) -> Result<Vec<&'a Variable>> {
    if let Some(variable) = description.variable(name) {
        return Ok(vec![variable]);
    }
    let is_element = |variable: &&Variable| {
        variable.name.strip_prefix(name).is_some_and(|index| index.starts_with('[') && index.ends_with(']'))
    };
    let found: Vec<_> = description.variables.iter().filter(is_element).collect();
    if found.is_empty() {
        let near = nearest(name, description.variables.iter().map(|variable| variable.name.clone()));
        let near = near.map_or(String::new(), |near| format!("; did you mean {near}?"));
        bail!("there is no variable {name} to {purpose}{near}");
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MODEL: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
        <CoSimulation modelIdentifier="m"/>
        <TypeDefinitions><EnumerationType name="Mode"><Item name="closed" value="1"/><Item name="open" value="5"/>
        <Item name="7" value="6"/><Item name="6" value="7"/>
        </EnumerationType></TypeDefinitions>
        <ModelVariables>
            <Float64 name="time" valueReference="0" causality="independent"/>
            <Float64 name="speed" valueReference="1" causality="input" start="0"/>
            <Enumeration name="mode" declaredType="Mode" valueReference="2" causality="input" start="1"/>
            <Boolean name="on" valueReference="3" causality="input" start="false"/>
            <String name="text" valueReference="4" causality="input"><Start value=""/></String>
            <Int64 name="count" valueReference="5" causality="input" start="0"/>
            <Int32 name="gear" valueReference="6" causality="input" start="0"/>
            <Float64 name="p" valueReference="7" causality="input" start="0 0"><Dimension start="2"/></Float64>
        </ModelVariables><ModelStructure/></fmiModelDescription>"#;

    fn read(text: &str) -> Result<Table> {
        let directory = tempfile::tempdir()?;
        let path = directory.path().join("table.csv");
        fs::write(&path, text)?;
        Table::read(&path, &Description::parse(MODEL).map_err(anyhow::Error::msg)?)
    }

    /// Returns the values of an input.
    fn values(table: &Table, name: &str) -> Vec<Value> {
        let inputs = table.trajectories();
        match inputs.iter().find(|(of, _)| *of == name).unwrap().1 {
            Trajectory::Sampled { values, .. } => values.iter().copied().map(Value::Real).collect(),
            Trajectory::SampledValues { values, .. } => values.to_vec(),
            other => panic!("{other:?}"),
        }
    }

    /// A table as spreadsheets and other tools write it.
    #[test]
    fn values_are_read_by_their_types() {
        let table = read(
            "\u{feff}time;mode;on;text;count;gear;speed;p\r\n0;open;TRUE;\"a; b\";9007199254740993;3;1e-310;2\r\n\
             0.5;1;0;;-1;-4;-0;3\r\n0.5;open;false;c;2;5.0;7;4\r\n",
        )
        .unwrap();
        assert_eq!(table.time, [0.0, 0.5, 0.5]);
        assert_eq!(values(&table, "mode"), [5.0, 1.0, 5.0].map(Value::Real));
        assert_eq!(values(&table, "on"), [1.0, 0.0, 0.0].map(Value::Real));
        assert_eq!(values(&table, "text"), ["a; b", "", "c"].map(Value::from));
        assert_eq!(values(&table, "count"), [9007199254740993, -1, 2].map(Value::Integer));
        assert_eq!(values(&table, "gear"), [3.0, -4.0, 5.0].map(Value::Real));
        assert_eq!(values(&table, "speed"), [1e-310, -0.0, 7.0].map(Value::Real));
        assert_eq!(values(&table, "p[2]"), [2.0, 3.0, 4.0].map(Value::Real));
        // The items 7 and 6 have the values 6 and 7.
        let table = read("time,mode\n0,7\n1,6\n2,5\n").unwrap();
        assert_eq!(values(&table, "mode"), [6.0, 7.0, 5.0].map(Value::Real));
    }

    #[test]
    fn errors_name_the_line_and_the_remedy() {
        for (text, message) in [
            ("t,speed\n0,1\n", "there is no variable t to set"),
            ("speed\n1\n", "has no column time, in s; its columns are speed"),
            ("time,sped\n0,1\n", "there is no variable sped to set; did you mean speed?"),
            ("time,speed,speed\n0,1,1\n", "has two columns speed"),
            ("time,speed\n", "has no values"),
            ("time,speed\n0,1\n1,x\n", "line 3: speed cannot be \"x\": it must be a finite number"),
            ("time,speed\n0,inf\n", "line 2: speed cannot be \"inf\": it must be a finite number"),
            ("time,speed\n0,\n", "line 2: speed cannot be \"\": it must be a finite number"),
            ("time;speed\n0,5;1\n", "line 2: time cannot be \"0,5\": write numbers with a decimal point"),
            ("time,speed\n0,1\n0.5\n", "record 2 (line: 3"),
            ("time,mode\n0,opem\n", "line 2: mode cannot be \"opem\": it must be one of closed, open, 7, 6"),
            ("time,mode\n0,2\n", "line 2: mode cannot be \"2\": it must be one of closed, open, 7, 6"),
            ("time,gear\n0,2.5\n", "line 2: gear cannot be \"2.5\": it must be an integer"),
            ("time,count\n0,2.5\n", "line 2: count cannot be \"2.5\": it must be an integer"),
            ("time,on\n0,2\n", "line 2: on cannot be \"2\": it must be true or false"),
            ("time,speed\n1,1\n0,1\n", "line 3: the time 0 follows 1; times must not decrease"),
        ] {
            let error = read(text).err().map(|error| format!("{error:#}")).unwrap_or_default();
            assert!(error.contains(message) && error.contains("table.csv"), "{text:?}: {error}");
        }
    }
}
