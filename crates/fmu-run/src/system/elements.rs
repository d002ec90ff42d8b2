//! Finds whole arrays among variables. FMI 2.0 has only elements, named `y[1]` or `A[2,3]` (section 2.2.9), and this crate gives the
//! elements of FMI 3.0 arrays the same names.

use std::collections::HashMap;

/// An array of variables.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Elements {
    /// Names of the elements; the last index varies fastest.
    pub names: Vec<String>,
    /// Size of each dimension.
    pub sizes: Vec<usize>,
}

/// Finds the arrays among these variables by name. The indices of an array must fill all dimensions, from 1 or from 0.
pub(super) fn arrays<'a>(names: impl Iterator<Item = &'a str>) -> HashMap<String, Elements> {
    let mut found: HashMap<String, Vec<(Vec<usize>, &str)>> = HashMap::new();
    for name in names {
        if let Some((array, indices)) = split(name) {
            found.entry(array).or_default().push((indices, name));
        }
    }
    found.into_iter().filter_map(|(array, elements)| Some((array, complete(elements)?))).collect()
}

/// Splits the name of an element into the name of the array and the indices. In `der(x[1])`, the array is `der(x)`.
fn split(name: &str) -> Option<(String, Vec<usize>)> {
    let end = name.rfind(']')?;
    let rest = &name[end + 1..];
    let is_derivative = name.starts_with("der(") && rest.starts_with([')', ',']) && rest.ends_with(')');
    if !rest.is_empty() && !is_derivative {
        return None;
    }
    let begin = name[..end].rfind('[')?;
    let indices = name[begin + 1..end].split(',').map(|index| index.trim().parse().ok());
    Some((format!("{}{rest}", &name[..begin]), indices.collect::<Option<_>>()?))
}

/// Returns the array that consists of these elements, if none is missing.
fn complete(mut elements: Vec<(Vec<usize>, &str)>) -> Option<Elements> {
    elements.sort_unstable();
    let (first, last) = (&elements.first()?.0, &elements.last()?.0);
    if elements.iter().any(|(indices, _)| indices.len() != first.len())
        || first.iter().any(|index| *index > 1)
    {
        return None;
    }
    let sizes: Vec<_> = first
        .iter()
        .zip(last)
        .map(|(first, last)| last.checked_add(1)?.checked_sub(*first))
        .collect::<Option<_>>()?;
    // In sorted order, the indices of every element follow from its number.
    let is_at = |(number, (indices, _)): (usize, &(Vec<usize>, &str))| {
        let mut rest = number;
        let own = indices.iter().zip(&sizes).zip(first).rev().all(|((index, size), first)| {
            let expected = first + rest % size;
            rest /= size;
            *index == expected
        });
        own && rest == 0
    };
    let count = sizes.iter().try_fold(1_usize, |count, size| count.checked_mul(*size))?;
    let is_complete = count == elements.len() && elements.iter().enumerate().all(is_at);
    is_complete
        .then(|| Elements { names: elements.into_iter().map(|(_, name)| name.to_owned()).collect(), sizes })
}

#[cfg(test)]
mod tests {
    use super::arrays;

    #[test]
    fn elements_form_arrays() {
        let names = [
            "y[2]",
            "y[1]",
            "y[10]",
            "A[1,1]",
            "A[1,2]",
            "A[2,1]",
            "A[2,2]",
            "A[3,1]",
            "A[3,2]",
            "zero[0]",
            "zero[1]",
            "part[1].x[1]",
            "part[1].x[2]",
            "part[2].y",
            "der(x[1])",
            "der(x[2])",
            "der(x[1],2)",
            "der(x[2],2)",
            "gap[1]",
            "gap[3]",
            "mixed[1]",
            "mixed[1,2]",
            "from_two[2]",
            "from_two[3]",
            "twice[1]",
            "twice[1]",
            "ragged[1,1]",
            "ragged[2,1]",
            "ragged[2,2]",
            "huge[1]",
            "huge[18446744073709551615]",
            "name[a]",
            "plain",
            "]",
            "x]",
            "y[3]",
            "y[4]",
            "y[5]",
            "y[6]",
            "y[7]",
            "y[8]",
            "y[9]",
            "odd[1,3]",
            "odd[2,1]",
            "odd[2,2]",
            "odd[2,3]",
        ];
        let found = arrays(names.into_iter());
        let mut known: Vec<_> = found.keys().map(String::as_str).collect();
        known.sort_unstable();
        assert_eq!(known, ["A", "der(x)", "der(x,2)", "part[1].x", "y", "zero"]);
        assert_eq!(found["A"].sizes, [3, 2]);
        assert_eq!(found["A"].names, ["A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]", "A[3,1]", "A[3,2]"]);
        assert_eq!((found["y"].names[9].as_str(), &*found["y"].sizes), ("y[10]", &[10][..]));
        assert_eq!(found["der(x,2)"].names, ["der(x[1],2)", "der(x[2],2)"]);
    }
}
