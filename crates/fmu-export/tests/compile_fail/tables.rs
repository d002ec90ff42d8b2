//! Tables and capabilities that contradict themselves, found while constants are evaluated.

// Where a value is set and how it is read go together.
mod array_and_scalar {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// Inputs
        u = input(&NUMBER) in list by |plant| plant.u;
    }
}

// Element by element: a derivative has as many as its state.
mod array_of_another_length {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// States
        T = output(&NUMBER).state() in list;
        /// Their rates, but for one
        der_T as "der(T)" = local(&NUMBER).derivative_of(T) by |plant| [plant.u; 7];
    }
}

// Nobody could set it.
mod array_without_elements {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// Nothing
        y = output(&NUMBER) by |_| [0.0; 0];
    }
}

// A capability that is implemented is named.
mod capability_not_named {
    include!("shared/model.rs");

    impl ModelExchange for Plant {}

    offer!(Plant: CoSimulation);
}

// What FMI 3.0 has more.
mod clock {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// Ticks
        tick = clock(&BOOLEAN);
        /// How many
        n = structural_parameter(&INTEGER) in n;
    }
}

// A constant is exact (section 2.2.7).
mod constant_approx {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&NUMBER).constant().approx() in x;
    }
}

// Names of elements are names.
mod element_of_the_same_name {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// Its elements are T[1], T[2] and so on
        T = input(&NUMBER) in list;
        /// One of them again
        T3 as "T[3]" = input(&NUMBER) in u;
    }
}

// The time is the instance's.
mod independent_with_by {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// The time
        time = independent(&TIME) by |plant| plant.x;
    }
}

// An input changes (section 2.2.7).
mod input_constant {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER).constant() in u;
    }
}

// Only what is calculated depends on others.
mod input_depends_on {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER).depends_on(&[u]) in u;
    }
}

// An input has no initial (section 2.2.7).
mod input_exact {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER).exact() in u;
    }
}

// An input lives somewhere.
mod input_with_by_only {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER) by |plant| plant.u;
    }
}

// Only a Real has a rate.
mod integer_derivative {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A state
        x = output(&NUMBER).state() in x;
        /// Its rate
        n = local(&INTEGER).derivative_of(x) by |plant| plant.n;
    }
}

// Only a Real is continuous (section 2.2.7).
mod integer_state {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A state
        n = output(&INTEGER).state() in n;
    }
}

// Users read what a variable is.
mod no_description {
    include!("shared/fields.rs");

    variables! { for Plant;
        u = input(&NUMBER) in u;
    }
}

// A variable has a place or a calculation.
mod nothing_said {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&NUMBER);
    }
}

// An output is no parameter (section 2.2.7).
mod output_tunable {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&NUMBER).tunable() in x;
    }
}

// A parameter has an exact value (section 2.2.7).
mod output_with_wrong_initial {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A parameter
        gain = parameter(&NUMBER).approx() in x;
    }
}

// A parameter is fixed or tunable (section 2.2.7).
mod parameter_discrete {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A parameter
        gain = parameter(&NUMBER).discrete() in x;
    }
}

// What importers set lives somewhere.
mod parameter_without_index {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A parameter
        gain = parameter(&NUMBER) by |plant| plant.x;
    }
}

// A text has no range.
mod range_of_a_text {
    use fmu_export::*;

    pub const TEXT: Type = STRING.min(0.0);

}

// Every state has a derivative.
mod state_without_derivative {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A state with one
        u = output(&NUMBER).state() in u;
        /// Its rate
        du = local(&NUMBER).derivative_of(u) by |plant| plant.u;
        /// A state without
        x = output(&NUMBER).state() in x;
    }
}

// A state lives somewhere.
mod state_without_index {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// A state
        x = output(&NUMBER).state() by |plant| plant.x;
        /// Its rate
        dx = local(&NUMBER).derivative_of(x) by |plant| plant.u;
    }
}

// Names are unique for importers, too.
mod two_of_one_label {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An input
        u = input(&NUMBER) in u;
        /// Another
        w as "u" = input(&NUMBER) in x;
    }
}

// An Integer lives in an i32.
mod wrong_type_in_place {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&INTEGER) in x;
    }
}

// A Real is an f64.
mod wrong_type_of_calculation {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// An output
        y = output(&NUMBER) by |plant| plant.n;
    }
}

fn main() {}
