//! Why an instance refuses something, in the words of its FMU.

use fmi_abi::Status;

/// What an FMU has logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The status that goes with it.
    pub status: Status,
    /// One of the log categories.
    pub category: String,
    /// The text.
    pub text: String,
}

/// What an instance answered instead of OK or Warning: the function, and what it logged. In a box, as it is seldom made and
/// each call may answer with it.
#[derive(Debug)]
pub struct Refusal(Box<Refused>);

#[derive(Debug)]
struct Refused {
    /// The component; empty where there is only one.
    component: String,
    function: &'static str,
    status: Status,
    log: Vec<Message>,
    ended: Option<f64>,
}

impl Refusal {
    #[cold]
    pub(crate) fn new(component: &str, function: &'static str, status: Status, log: Vec<Message>) -> Self {
        Self(Box::new(Refused { component: component.to_owned(), function, status, log, ended: None }))
    }

    /// What no FMU has refused.
    #[cold]
    pub(crate) fn of_ours(what: &'static str, why: &str) -> Self {
        let message = Message { status: Status::Error, category: String::new(), text: why.to_owned() };
        Self::new("", what, Status::Error, vec![message])
    }

    pub(crate) fn status(&self) -> Status {
        self.0.status
    }

    /// The FMU wants to end the simulation, at this time.
    pub(crate) fn at_end(mut self, time: f64) -> Self {
        self.0.ended = Some(time);
        self
    }

    /// When the FMU has ended the simulation, if that is what it wants.
    pub(crate) fn ended(&self) -> Option<f64> {
        self.0.ended
    }

    /// Whether it comes without a reason.
    pub(crate) fn is_silent(&self) -> bool {
        self.0.log.is_empty() && self.0.ended.is_none()
    }
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Refused { component, function, status, log, ended } = &*self.0;
        let message = reason(log);
        if !component.is_empty() {
            write!(f, "{component}: ")?;
        }
        if let Some(time) = ended {
            write!(f, "ended by the FMU at t = {time} s")?;
            return message.map_or(Ok(()), |message| write!(f, ": {}", message.text.trim()));
        }
        match message {
            // Some FMUs name the function, some do not.
            Some(message) if message.text.contains(function) => f.write_str(message.text.trim()),
            Some(message) => write!(f, "{}: {}", function, message.text.trim()),
            None => write!(f, "{} was answered with {:?}, without a message", function, status),
        }
    }
}

impl std::error::Error for Refusal {}

/// What of a log tells why something was refused.
pub(crate) fn reason(log: &[Message]) -> Option<&Message> {
    let grave = log.iter().rev().find(|message| message.status as i32 >= Status::Discard as i32);
    grave.or(log.last())
}
