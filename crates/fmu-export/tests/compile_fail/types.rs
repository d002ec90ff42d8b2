//! Types, fields and functions that do not exist or do not fit.

// A capability that is named is implemented.
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

// A capability is named once.
mod capability_twice {
    include!("shared/model.rs");

    offer!(Plant: CoSimulation + CoSimulation);
}

// No variable is a character.
mod no_type_for_values {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&INTEGER) by |_| '7';
    }
}

// No variable is a duration.
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

// A place is a field of the model, and a kind is a function of Variable.
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
