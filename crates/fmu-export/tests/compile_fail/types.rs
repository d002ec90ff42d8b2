//! Types, fields and functions that do not exist or do not fit.

// A capability that is named in `offer!` must be implemented.
mod capability_not_implemented {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// In
        u = input(&NUMBER) in u;
    }

    impl Model for Plant {
        const INFO: Info = info!("Plant", "plant");

        fn new(_: &Setup) -> Result<Self, Error> {
            Ok(Self { u: 0.0, x: 0.0, n: 0, list: [0.0; 8] })
        }
    }

    offer!(Plant: CoSimulation);
}

// A start value has the type of its field.
mod start_of_another_type {
    use fmu_export::*;

    variables! {
        /// A model
        pub struct Plant;
        /// An input
        u: f64 = input(&NUMBER).start(1);
    }
}

// A capability must be named only once.
mod capability_twice {
    include!("shared/model.rs");

    offer!(Plant: CoSimulation + CoSimulation);
}

// `char` is not a type of variables.
mod no_type_for_values {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&INTEGER) by |_| '7';
    }
}

// `Duration` is not a type of variables.
mod no_type_in_place {
    use fmu_export::*;

    #[derive(Clone)]
    pub struct Plant {
        delay: [std::time::Duration; 2],
    }

    variables! { for Plant;
        /// An input
        u = input(&NUMBER) in delay[1];
    }
}

// After `in`, a field of the model is needed, and after `=` a function of `Variable`.
mod unknown_names {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER) in w;
        /// Another input
        v = inlet(&NUMBER) in u;
    }
}

fn main() {}
