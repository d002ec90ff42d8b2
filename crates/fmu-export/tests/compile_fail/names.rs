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

// The second table in a module needs another name than `Name` for its names.
mod two_tables {
    use fmu_export::*;

    variables! {
        /// A model
        pub struct One;
        /// An input
        u: f64 = input(&NUMBER);
    }

    variables! {
        /// Another
        pub struct Other;
        /// An input
        u: f64 = input(&NUMBER);
    }
}

// A start value needs a field that the table declares.
mod start_of_a_field {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER).start(0.5) in u;
    }
}

// A library is one FMU.
mod two_fmus {
    mod one {
        include!("shared/model.rs");

        export_fmu!(Plant: CoSimulation);
    }

    mod other {
        include!("shared/model.rs");

        export_fmu!(Plant: CoSimulation);
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
