//! A model with Strings and rare kinds of variables that uses log messages, resources, the name of its instance and the
//! experiment.

use fmu_export::*;

enumeration! {
    /// How it talks.
    pub enum Mood {
        /// Says what it is told
        Calm = 1,
        /// Says it with emphasis
        Excited = 2,
        /// Says nothing
        Sulking = 7,
    }
}

const MOOD: Type = Type::enumeration("Mood", <Mood as Enumeration>::ITEMS);
const LEVEL: Type = Type::real("Level", &units::ONE).min(0.0).max(11.0);
const SQUARE: Type = Type::real("Square", &units::ONE).min(1e-6).max(1e6);

variables! {
    /// Repeats what it hears, in a way that depends on its mood.
    pub struct Talker {
        /// The greeting, and the replies so far; at most 100 strings.
        said: Vec<String>,
        /// The root that was found.
        found: f64 = 1.0,
        who: String,
        words: String,
        experiment: Experiment,
        log: Log,
    }, memory in said, experiment.start_time, experiment.stop_time, experiment.tolerance;

    /// String that it hears
    heard: String = input(&STRING);
    /// Reply
    reply = output(&STRING) by |talker| talker.reply();
    /// Last reply
    said = output(&STRING) by |talker| talker.said.last().cloned().unwrap_or_default();
    /// First reply
    greeting: String = parameter(&STRING).start("Hello".to_owned());
    /// How it talks
    mood: Mood = input(&MOOD).start(Mood::Calm);
    /// Mood again
    own_mood = output(&MOOD) by |talker| talker.mood;
    /// Volume, tunable during the simulation
    volume: f64 = parameter(&LEVEL).tunable().start(5.0);
    /// Volume in decibels
    decibels = calculated_parameter(&NUMBER).tunable() by |talker| 20.0 * (1e-3 + talker.volume).log10();
    /// Length of the greeting
    length = calculated_parameter(&INTEGER) by |talker| talker.greeting.len() as i32;
    /// Number whose square root it finds
    square: f64 = parameter(&SQUARE).start(2.0);
    /// The root, from a start value on
    root: f64 = local(&NUMBER).approx().start(1.0) by |talker| talker.found;
    /// The answer
    answer = output(&INTEGER).constant() by |_| 42;
    /// The time
    time = independent(&TIME);
    /// Who it is
    who = local(&STRING).fixed() by |talker| talker.who.clone();
    /// Content of its resource file
    words = local(&STRING).fixed() by |talker| talker.words.clone();
    /// Start time
    begin = local(&TIME).fixed() by |talker| talker.experiment.start_time;
    /// Stop time, or -1
    end = local(&TIME).fixed() by |talker| talker.experiment.stop_time.unwrap_or(-1.0);
    /// Tolerance, or -1
    tolerance = local(&NUMBER).fixed() by |talker| talker.experiment.tolerance.unwrap_or(-1.0);
}

impl Talker {
    fn reply(&self) -> String {
        match self.mood {
            Mood::Calm => self.heard.clone(),
            Mood::Excited => format!("{}!", self.heard),
            Mood::Sulking => String::new(),
        }
    }
}

impl Model for Talker {
    const INFO: Info = Info { description: "Says what it hears", ..info!("Talker", "talker") };

    fn new(setup: &Setup) -> Result<Self, Error> {
        let path = setup.resources().map(|directory| directory.join("words.txt"));
        let words = match path.map(std::fs::read_to_string) {
            Some(Ok(words)) if words.trim().is_empty() => {
                return Err(Error::new("resources/words.txt is empty"));
            }
            Some(Ok(words)) => words.trim().to_owned(),
            _ => "none".to_owned(),
        };
        Ok(Self { who: setup.instance_name.clone(), words, ..Self::default() })
    }

    fn update(&mut self) -> Result<(), Error> {
        if self.volume > 10.0 {
            self.log.warning(format!("a volume of {} hurts", self.volume));
        }
        Ok(())
    }

    fn initialize(&mut self, experiment: &Experiment) -> Result<(), Error> {
        self.experiment = *experiment;
        self.said = vec![self.greeting.clone()];
        Ok(())
    }

    /// Calculates the root with at most 60 iterations of Newton's method, which begins at the start value.
    fn calculate(&mut self, _: f64) {
        let rounds = (0..60).try_fold(self.root, |root, _| {
            let next = 0.5 * (root + self.square / root);
            next.is_finite().then_some(next)
        });
        self.found = rounds.unwrap_or(self.root);
    }

    fn log(&mut self) -> Option<&mut Log> {
        Some(&mut self.log)
    }
}

impl CoSimulation for Talker {
    fn step(&mut self, _: Step) -> Result<Stepped, Error> {
        let reply = self.reply();
        if !reply.is_empty() && self.said.len() < 100 {
            self.log.event(format!("says {reply}"));
            self.said.push(reply);
        }
        Ok(Stepped::Done)
    }
}

impl ModelExchange for Talker {}

offer!(Talker: CoSimulation + ModelExchange);
