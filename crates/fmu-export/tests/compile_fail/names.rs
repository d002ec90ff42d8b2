//! Names that are defined twice, and names that are not defined.

// Variables must have different names.
mod two_of_one_name {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER) in u;
        /// Another
        u = input(&NUMBER) in x;
    }
}

// Only variables of the table can be named in a line.
mod unknown_names {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&NUMBER).depends_on(&[w]) by |plant| plant.u;
        /// A rate
        dx = local(&NUMBER).derivative_of(z) by |plant| plant.u;
    }
}

// There are five capabilities.
mod capability_unknown {
    include!("shared/model.rs");

    offer!(Plant: CoSimulation + Magic);
}

fn main() {}
