//! Invalid tables and capabilities that are detected while constants are evaluated. The description of a variable is the
//! rule that its line violates, unless it begins with "Valid".

mod lines {
    include!("shared/fields.rs");

    variables! { for Plant;
        /// The value that is set and the value that is read have equal dimensions
        array_and_scalar = input(&NUMBER) in list by |plant| plant.u;
        /// Valid: states with derivatives
        T = output(&NUMBER).state() in list;
        /// A derivative has the dimensions of its state
        array_of_another_length = local(&NUMBER).derivative_of(T) by |plant| [plant.u; 7];
        /// An array has elements
        array_without_elements = output(&NUMBER) by |_| [0.0; 0];
        /// There are no clocks
        clock = clock(&BOOLEAN);
        /// There are no structural parameters
        structural = structural_parameter(&INTEGER) in n;
        /// A constant is exact (section 2.2.7 of FMI 2.0)
        constant_approx = output(&NUMBER).constant().approx() in x;
        /// Names differ from the names of array elements
        element_of_the_same_name as "T[3]" = input(&NUMBER) in u;
        /// The value of the time is the time of the instance
        independent_with_by = independent(&TIME) by |plant| plant.x;
        /// An input is not constant (section 2.2.7 of FMI 2.0)
        input_constant = input(&NUMBER).constant() in u;
        /// An input has no dependencies
        input_depends_on = input(&NUMBER).depends_on(&[input_constant]) in u;
        /// An input has no initial (section 2.2.7 of FMI 2.0)
        input_exact = input(&NUMBER).exact() in u;
        /// An input has a field
        input_with_by_only = input(&NUMBER) by |plant| plant.u;
        /// Valid: a state with a derivative
        x = output(&NUMBER).state() in x;
        /// A derivative is a Real
        integer_derivative = local(&INTEGER).derivative_of(x) by |plant| plant.n;
        /// A continuous variable is a Real (section 2.2.7 of FMI 2.0)
        integer_state = output(&INTEGER).state() in n;
        // A variable has a description, which this one lacks.
        no_description = input(&NUMBER) in u;
        /// A variable has a field or a calculation
        nothing = output(&NUMBER);
        /// An output is not tunable (section 2.2.7 of FMI 2.0)
        output_tunable = output(&NUMBER).tunable() in x;
        /// The value of a parameter is exact (section 2.2.7 of FMI 2.0)
        parameter_approx = parameter(&NUMBER).approx() in x;
        /// A parameter is fixed or tunable (section 2.2.7 of FMI 2.0)
        parameter_discrete = parameter(&NUMBER).discrete() in x;
        /// A parameter has a field
        parameter_without_field = parameter(&NUMBER) by |plant| plant.x;
        /// A state has a derivative
        state_without_derivative = output(&NUMBER).state() in u;
        /// A state has a field
        state_without_field = output(&NUMBER).state() by |plant| plant.x;
        /// Valid: the derivative of this state
        rate = local(&NUMBER).derivative_of(state_without_field) by |plant| plant.u;
        /// Names of variables differ
        two_of_one_label as "x" = input(&NUMBER) in x;
        /// The value of an Integer is an i32
        wrong_type_of_field = output(&INTEGER) in x;
        /// The value of a Real is an f64
        wrong_type_of_calculation = output(&NUMBER) by |plant| plant.n;
    }
}

// A capability that is implemented must be named in `offer!`.
mod capability_not_named {
    include!("shared/model.rs");

    impl ModelExchange for Plant {}

    offer!(Plant: CoSimulation);
}

// A string has no range.
mod range_of_a_string {
    pub const STRING: fmu_export::Type = fmu_export::STRING.min(0.0);
}

fn main() {}
