//! Arrays of FMI 3.0. In this crate each element is a variable, but the FMU has only the array, with one value reference. Each call
//! reads or sets all values of an array (section 2.2.7.2 of FMI 3.0).

use fmi_abi::description::Variable;
use fmi_abi::{BaseType, Value};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Maximum number of elements of all arrays together. If an array exceeds it, its elements are not variables.
const MAX_ELEMENTS: usize = 1 << 20;
/// Maximum memory of the elements of all arrays, in bytes.
const MAX_BYTES: usize = 256 << 20;
/// Estimated memory of an element without its name and indices, in bytes.
const ELEMENT: usize = 160;

/// The arrays of an FMU. Each element has a number that serves as its value reference. These numbers are larger than all value
/// references of the FMU.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Arrays {
    all: Vec<Array>,
    /// Number of the first element of the first array.
    first: u32,
    /// For each element, the index of its array and its number in the array.
    elements: Vec<(u32, u32)>,
    /// Estimated memory of the elements, in bytes.
    bytes: usize,
}

/// An array.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Array {
    pub reference: u32,
    pub base: BaseType,
    sizes: Vec<usize>,
    /// Number of elements.
    pub length: usize,
    /// Start values as in the model description: one for all elements, or one for each.
    start: Vec<Arc<str>>,
}

impl Array {
    /// Creates an array from its declaration in the model description. Returns `None` if its size is unknown or too large.
    pub fn new(of: &Variable, base: BaseType) -> Option<Self> {
        let (reference, start) = (of.reference, of.start.iter().map(|start| Arc::from(&**start)).collect());
        let sizes = of.dimensions.clone()?;
        let length = sizes.iter().try_fold(1_usize, |length, size| length.checked_mul(*size));
        let length = length.filter(|length| *length <= MAX_ELEMENTS)?;
        Some(Self { reference, base, sizes, length, start })
    }

    /// Returns whether the model description contains a start value for each element, and not one for all.
    pub fn has_separate_starts(&self) -> bool {
        self.start.len() > 1
    }

    /// Returns the start value of the element with this number, from 0, if there is one.
    pub fn start(&self, number: usize) -> Option<&Arc<str>> {
        match &*self.start {
            [one] => Some(one),
            all => all.get(number),
        }
    }

    /// Returns the name of the element with this number, in the notation of FMI 2.0 (section 2.2.9 there): `T[1,2]`, with indices
    /// from 1. In `der(T[1])` they follow the variable.
    pub fn name(&self, array: &str, number: usize) -> String {
        let mut rest = number;
        let mut indices: Vec<_> = self
            .sizes
            .iter()
            .rev()
            .map(|size| {
                let index = rest % size + 1;
                rest /= size;
                index.to_string()
            })
            .collect();
        indices.reverse();
        let end = if array.starts_with("der(") { array.find([',', ')']) } else { None };
        let (variable, behind) = array.split_at(end.unwrap_or(array.len()));
        format!("{variable}[{}]{behind}", indices.join(","))
    }
}

/// Values of arrays that were set before Initialization Mode, by index of the array.
#[derive(Debug, Default)]
pub(crate) struct ArrayStartValues {
    pub numbers: HashMap<usize, Vec<f64>>,
    pub values: HashMap<usize, Vec<Value>>,
}

/// Variables of the FMU that cover the requested variables: scalars, and whole arrays instead of elements.
#[derive(Debug, Default)]
pub(crate) struct Expanded {
    /// Value references of the FMU.
    pub references: Vec<u32>,
    /// Number of values of these variables.
    pub count: usize,
    /// For each requested variable, the index of its value among them.
    pub indices: Vec<usize>,
    /// For each array, its index in [`Arrays`] and the index of its first value.
    pub arrays: Vec<(usize, usize)>,
}

impl Expanded {
    /// Returns whether every element of these arrays was requested.
    pub fn is_complete(&self) -> bool {
        let mut named = vec![false; self.count];
        self.indices.iter().for_each(|index| named[*index] = true);
        named.iter().all(|named| *named)
    }
}

impl Arrays {
    /// Creates an empty list for an FMU whose largest value reference is `largest`.
    pub fn after(largest: u32) -> Self {
        Self { first: largest.saturating_add(1), ..Self::default() }
    }

    pub fn all(&self) -> &[Array] {
        &self.all
    }

    /// Adds an array with its name and its aliases. Returns the numbers of its elements, or `None` if there are too many or they need
    /// too much memory.
    pub fn push<'a>(&mut self, array: Array, names: impl Iterator<Item = &'a str>) -> Option<Range<u32>> {
        let length = array.length;
        let begin = u32::try_from(self.elements.len()).ok()?.checked_add(self.first)?;
        let end = begin.checked_add(u32::try_from(length).ok()?)?;
        // The name of an element has an index for each dimension.
        let indices: usize = array.sizes.iter().map(|size| size.to_string().len() + 1).sum();
        let each: usize = names.map(|name| ELEMENT + 2 * (name.len() + indices)).sum();
        let bytes = self.bytes.checked_add(length.checked_mul(each)?)?;
        if self.elements.len() + length > MAX_ELEMENTS || bytes > MAX_BYTES {
            return None;
        }
        self.elements.try_reserve(length).ok()?;
        self.bytes = bytes;
        let index = self.all.len();
        let own = u32::try_from(index).ok()?;
        self.elements.extend((0..length as u32).map(|number| (own, number)));
        self.all.push(array);
        Some(begin..end)
    }

    /// Returns the estimated memory of the elements, in bytes.
    pub fn bytes(&self) -> usize {
        self.bytes
    }

    /// Returns the index of the array to which an element belongs, and the number of the element in the array. Returns `None` for a
    /// scalar.
    #[inline]
    pub fn find(&self, reference: u32) -> Option<(usize, usize)> {
        let (array, number) = self.elements.get(reference.checked_sub(self.first)? as usize)?;
        Some((*array as usize, *number as usize))
    }

    /// Returns whether any of these variables is an array element.
    #[inline]
    pub fn among(&self, references: &[u32]) -> bool {
        !self.elements.is_empty() && references.iter().any(|reference| *reference >= self.first)
    }

    /// Replaces each array element by its array.
    pub fn expanded(&self, references: &[u32]) -> Expanded {
        let mut expanded = Expanded::default();
        let mut begins = HashMap::new();
        for reference in references {
            let Some((array, number)) = self.find(*reference) else {
                expanded.references.push(*reference);
                expanded.indices.push(expanded.count);
                expanded.count += 1;
                continue;
            };
            let begin = *begins.entry(array).or_insert_with(|| {
                let begin = expanded.count;
                expanded.references.push(self.all[array].reference);
                expanded.arrays.push((array, begin));
                expanded.count += self.all[array].length;
                begin
            });
            expanded.indices.push(begin + number);
        }
        expanded
    }
}

#[cfg(test)]
mod tests {
    use crate::description::Description;

    const TEXT: &str = r#"<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{}">
        <ModelExchange modelIdentifier="m"/>
        <ModelVariables>
            <UInt64 name="n" valueReference="7" causality="structuralParameter" start="3"/>
            <Float64 name="x" valueReference="2" causality="output" start="1 2 3"><Dimension valueReference="7"/></Float64>
            <Float64 name="der(x)" valueReference="4"><Dimension valueReference="7"/></Float64>
            <Int8 name="m" valueReference="3" start="5"><Dimension start="2"/><Dimension start="3"/></Int8>
            <String name="s" valueReference="9"><Dimension start="2"/><Start value="a b"/><Start value=""/></String>
            <Float64 name="huge" valueReference="8" start="0"><Dimension start="4000000000"/></Float64>
            <Float64 name="more" valueReference="6" start="0"><Dimension start="4294967296"/><Dimension start="4294967296"/></Float64>
            <Float64 name="unsized" valueReference="5"><Dimension valueReference="70"/></Float64>
            <Float64 name="y" valueReference="1" causality="output" unit="m"><Alias name="z" description="again" displayUnit="mm"/></Float64>
            <Float64 name="w" valueReference="11" start="1 2"><Dimension start="2"/><Alias name="v"/></Float64>
        </ModelVariables>
        <ModelStructure>
            <Output valueReference="2" dependencies="3 1"/>
            <ContinuousStateDerivative valueReference="4"/>
        </ModelStructure>
    </fmiModelDescription>"#;

    #[test]
    fn elements_are_variables() {
        let description = Description::parse(TEXT).unwrap();
        let names: Vec<_> = description.variables.iter().map(|of| of.name.as_str()).collect();
        let expected = "n x[1] x[2] x[3] der(x[1]) der(x[2]) der(x[3]) m[1,1] m[1,2] m[1,3] m[2,1] m[2,2] m[2,3] s[1] s[2] y w[1] w[2] z v[1] v[2]";
        assert_eq!(names.join(" "), expected);
        assert_eq!(description.states, 3);
        let of = |name| description.variable(name).unwrap();
        let start = |name| of(name).start.as_deref();
        assert_eq!(
            [start("x[3]"), start("m[2,2]"), start("s[1]"), start("s[2]")],
            [Some("3"), Some("5"), Some("a b"), Some("")]
        );
        let mut references: Vec<_> = description.variables.iter().map(|of| of.reference).collect();
        references.sort_unstable();
        references.dedup();
        assert_eq!(
            references.len(),
            names.len() - 3,
            "only aliases have the value reference of another variable"
        );
        assert_eq!(
            ["z", "v[1]", "v[2]"].map(|name| of(name).reference),
            ["y", "w[1]", "w[2]"].map(|name| of(name).reference)
        );
        let z = of("z");
        assert_eq!(
            (z.unit.as_deref(), z.display_unit.as_deref(), &*z.description),
            (Some("m"), Some("mm"), "again")
        );
        assert_eq!((start("v[2]"), z.causality), (Some("2"), of("y").causality));
        let why = |name| description.why_missing(name).unwrap();
        assert!(why("huge").starts_with("is an array with too many elements"));
        assert!(why("more").starts_with("is an array with too many elements"));
        assert_eq!(why("unsized"), "is an array of unknown size");
        let known: Vec<_> = (1..=2).flat_map(|i| (1..=3).map(move |j| format!("m[{i},{j}]"))).collect();
        let depends_on = of("x[2]").depends_on.as_ref().unwrap();
        assert!(known.iter().all(|known| depends_on.contains(of(known))) && depends_on.contains(of("y")));
        assert!(!depends_on.contains(of("x[1]")) && !depends_on.contains(of("n")));
    }

    #[test]
    fn arrays_are_passed_completely() {
        let description = Description::parse(TEXT).unwrap();
        let references: Vec<_> = ["x[3]", "y", "x[1]", "x[3]"]
            .iter()
            .map(|name| description.variable(name).unwrap().reference)
            .collect();
        let expanded = description.arrays.expanded(&references);
        assert_eq!((expanded.references.clone(), expanded.count), (vec![2, 1], 4));
        assert_eq!(expanded.indices, [2, 3, 0, 2]);
        assert!(!expanded.is_complete() && description.arrays.among(&references));
        assert!(!description.arrays.among(&[1, 2, 7]));
    }
}
