//! What is open and what is chosen: from choices to what the simulations are asked for.

use viscera::scene::Scene;

use crate::choices::{Choices, History, Settings, Side, difference, put};
use crate::document::Document;
use crate::engine::{BuildRequest, Command};

/// A scene with its choices.
#[derive(Debug)]
pub struct Session {
    document: Document,
    choices: Choices,
    /// What was chosen when the simulations began at rest.
    begun: Choices,
    history: History,
    /// One for each simulation, as chosen: the first, the second, the reference.
    scenes: Vec<Scene>,
    generation: u64,
}

impl Session {
    /// Opens a scene with settings of the command line.
    pub fn new(document: Document, shared: Settings) -> Result<Self, String> {
        let choices = Choices { shared, ..Choices::default() };
        let scenes = scenes_of(&document, &choices)?;
        let (begun, history) = (choices.clone(), History::default());
        Ok(Self { document, choices, begun, history, scenes, generation: 0 })
    }

    /// With a second solver beside the first from the beginning, with these settings of its own; alone where there are none.
    pub fn beside(mut self, settings: &Settings) -> Result<Self, String> {
        if settings.is_empty() {
            return Ok(self);
        }
        let mut second = self.solver_settings();
        settings.iter().for_each(|(key, value)| put(&mut second, key, value));
        let choices = Choices { second: Some(second), ..self.choices };
        self.scenes = scenes_of(&self.document, &choices)?;
        (self.choices, self.begun) = (choices.clone(), choices);
        Ok(self)
    }

    /// What the first solver has.
    fn solver_settings(&self) -> Settings {
        let values = self.scene(Side::First).solver.values();
        values.into_iter().map(|(key, value)| (format!("solver.{key}"), value)).collect()
    }

    /// The scene file.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// What is chosen.
    pub fn choices(&self) -> &Choices {
        &self.choices
    }

    /// What was chosen when the simulations began at rest.
    pub fn begun(&self) -> &Choices {
        &self.begun
    }

    /// The simulations begin at rest again.
    pub fn begin_again(&mut self) -> Command {
        self.begun = self.choices.clone();
        Command::Reset
    }

    /// What can be undone.
    pub fn history(&self) -> &History {
        &self.history
    }

    /// The scene of a side as chosen.
    pub fn scene(&self, side: Side) -> &Scene {
        match side {
            Side::Second if self.is_comparison() => &self.scenes[1],
            _ => &self.scenes[0],
        }
    }

    /// Whether two solvers are compared.
    pub fn is_comparison(&self) -> bool {
        self.choices.second.is_some()
    }

    /// Builds everything anew. Numbers of frames tell this from what was before.
    pub fn load(&mut self) -> Command {
        self.begun = self.choices.clone();
        Command::Load(self.build_request())
    }

    fn build_request(&mut self) -> Box<BuildRequest> {
        self.generation += 1;
        Box::new(BuildRequest {
            generation: self.generation,
            scenes: self.scenes.clone(),
            ends_with_ghost: self.choices.ghost,
            mesh_files: self.document.mesh_files(),
        })
    }

    /// Another scene file, with settings laid over it and those of a second solver beside; the same generation counter.
    pub fn open(
        &mut self,
        document: Document,
        settings: Settings,
        beside: &Settings,
    ) -> Result<Command, String> {
        let opened = Self::new(document, settings)?.beside(beside)?;
        *self = Self { generation: self.generation, ..opened };
        Ok(self.load())
    }

    /// Changes settings. On an error, which the library words, nothing has changed.
    pub fn choose(
        &mut self,
        side: Side,
        settings: &[(String, String)],
        gesture: bool,
    ) -> Result<Vec<Command>, String> {
        let mut next = self.choices.clone();
        for (key, value) in settings {
            next = next.with(side, key, value);
        }
        let key = settings.first().map_or("", |(key, _)| key.as_str()).to_owned();
        self.change_to(next, &key, gesture)
    }

    /// Begins or ends a comparison, or the reference beside it. The second solver begins as the first
    /// is, and has settings of its own from then on.
    pub fn compare(&mut self, on: bool, ghost: bool) -> Result<Vec<Command>, String> {
        let copy = || self.solver_settings();
        let second = on.then(|| self.choices.second.clone().unwrap_or_else(copy));
        let next = Choices { second, ghost, ..self.choices.clone() };
        self.change_to(next, "compare", false)
    }

    /// A simulation has refused a setting, and goes on with this value.
    pub fn keep(&mut self, run: usize, key: &str, value: &str) {
        let side = match run {
            0 => Side::First,
            1 if self.is_comparison() => Side::Second,
            _ => return,
        };
        let kept = self.choices.with(side, key, value);
        if let Ok(scenes) = scenes_of(&self.document, &kept) {
            (self.choices, self.scenes) = (kept, scenes);
        }
    }

    /// Nothing could be put beside the first simulation.
    pub fn stay_alone(&mut self) {
        let alone = Choices { second: None, ghost: false, ..self.choices.clone() };
        if let Ok(scenes) = scenes_of(&self.document, &alone) {
            (self.choices, self.scenes) = (alone, scenes);
        }
    }

    /// Nothing is being dragged any more: what follows is another step of undo.
    pub fn settle(&mut self) {
        self.history.settle();
    }

    /// Takes the last change back.
    pub fn undo(&mut self) -> Result<Vec<Command>, String> {
        match self.history.undo(&self.choices) {
            Some(before) => self.adopt(before),
            None => Ok(Vec::new()),
        }
    }

    /// Makes it again.
    pub fn redo(&mut self) -> Result<Vec<Command>, String> {
        match self.history.redo(&self.choices) {
            Some(after) => self.adopt(after),
            None => Ok(Vec::new()),
        }
    }

    fn change_to(
        &mut self,
        next: Choices,
        key: &str,
        gesture: bool,
    ) -> Result<Vec<Command>, String> {
        if next == self.choices {
            return Ok(Vec::new());
        }
        let before = self.choices.clone();
        let commands = self.adopt(next)?;
        self.history.record(&before, key, gesture);
        Ok(commands)
    }

    /// What takes the running simulations to other choices.
    fn adopt(&mut self, next: Choices) -> Result<Vec<Command>, String> {
        let scenes = scenes_of(&self.document, &next)?;
        let same_lanes = next.second.is_some() == self.choices.second.is_some()
            && next.ghost == self.choices.ghost;
        let first = difference(&self.scenes[0], &scenes[0]);
        let others = self.scenes.iter().zip(&scenes).skip(1);
        let others: Option<Vec<Settings>> = others.map(|(old, new)| difference(old, new)).collect();
        self.choices = next;
        self.scenes = scenes;
        let Some(first) = first else { return Ok(vec![self.load()]) };
        let mut commands = vec![Command::Change(0, first)];
        match others.filter(|_| same_lanes) {
            Some(others) => {
                let numbered = (1..).zip(others);
                commands.extend(numbered.map(|(run, change)| Command::Change(run, change)));
            }
            // The first goes on, whatever comes to its side.
            None => commands.push(Command::Accompany(self.build_request())),
        }
        commands.retain(
            |command| !matches!(command, Command::Change(_, settings) if settings.is_empty()),
        );
        Ok(commands)
    }
}

/// One scene for each simulation that the choices ask for.
fn scenes_of(document: &Document, choices: &Choices) -> Result<Vec<Scene>, String> {
    let read = |settings: &Settings| document.scene(settings).map_err(|error| error.to_string());
    let mut scenes = vec![read(&choices.of(Side::First))?];
    if choices.second.is_some() {
        scenes.push(read(&choices.of(Side::Second))?);
    }
    if choices.ghost {
        scenes.push(read(&choices.reference())?);
    }
    Ok(scenes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    fn session() -> Session {
        let document = Document::open(Path::new("grab"), None).expect("a built-in scene");
        Session::new(document, Settings::new()).expect("a legal scene")
    }

    fn pair(key: &str, value: &str) -> Vec<(String, String)> {
        vec![(key.to_owned(), value.to_owned())]
    }

    #[test]
    fn a_second_solver_stands_beside_the_first_from_the_beginning() {
        let plain = pair("solver.elements", "plain");
        let session = session().beside(&plain).expect("a comparison");
        assert!(session.is_comparison() && session.choices() == session.begun());
        let elements = [Side::First, Side::Second].map(|side| session.scene(side).solver.elements);
        assert_eq!(elements.map(|it| it.to_string()), ["auto", "plain"]);
        let error = self::session().beside(&pair("solver.elements", "square"));
        assert!(error.is_err_and(|error| error.contains("recovered")));
        let alone = self::session().beside(&Settings::new()).expect("one solver");
        assert!(!alone.is_comparison());
    }

    #[test]
    fn a_wrong_value_changes_nothing_and_says_why() {
        let mut session = session();
        let error = session
            .choose(Side::First, &pair("solver.iterations", "0"), false)
            .expect_err("no sweep at all");
        assert!(error.contains("solver.iterations") || error.contains("iterations"), "{error}");
        assert_eq!(*session.choices(), Choices::default());
        assert!(!session.history().can_undo());
    }

    #[test]
    fn changes_go_to_the_simulations_they_concern_and_undo_takes_them_back() {
        let mut session = session();
        let loaded = session.compare(true, false);
        assert!(matches!(loaded.expect("a comparison")[..], [Command::Accompany(_)]));
        let was = session.scene(Side::First).solver.iterations();
        let mut change = |value| {
            let commands = session.choose(Side::First, &pair("solver.iterations", value), false);
            let runs = commands.expect("a legal change").into_iter().map(|command| match command {
                Command::Change(run, settings) => (run, settings),
                other => panic!("{other:?}"),
            });
            runs.collect::<Vec<_>>()
        };
        // The second solver has its own number of iterations.
        assert_eq!(change("7"), [(0, pair("solver.iterations", "7"))]);
        assert!(change("7").is_empty());
        let undone = session.undo().expect("the change before");
        assert_eq!(session.scene(Side::First).solver.iterations(), was);
        assert_eq!(session.scene(Side::Second).solver.iterations(), was);
        assert!(was != 7 && undone.len() == 1);
    }
}
