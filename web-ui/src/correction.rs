//! What makes up for a robot's delay, slip and lag: nothing, the laboratory's delay compensation, or a model of the robot.

use api::experiment::{Experiment, Interaction, Mode};
use api::run::RunView;

/// Who corrects what the control law asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Correction {
    /// Nobody: the law sees where robots were measured.
    Nothing,
    /// The law sees where robots will be when its commands take effect; what a laboratory does unless it is told otherwise.
    Delay,
    /// The robots' models, in the mode `interactive`.
    Model,
}

/// Shortest, usual and longest look ahead of the models, s.
pub const HORIZON_S: [f64; 3] = [
    control::interaction::HORIZONS_S[0],
    0.3,
    control::interaction::HORIZONS_S[1],
];

impl Correction {
    pub const ALL: [Self; 3] = [Self::Nothing, Self::Delay, Self::Model];

    /// As on its button, and in names of widgets.
    pub const fn title(self) -> &'static str {
        match self {
            Self::Nothing => "None",
            Self::Delay => "Delay",
            Self::Model => "Model",
        }
    }

    /// What an experiment says.
    pub fn of(experiment: &Experiment) -> Self {
        match (experiment.control.interaction, experiment.mode) {
            (Some(_), Mode::Interactive) => Self::Model,
            _ if experiment.control.feedback_alone => Self::Nothing,
            _ => Self::Delay,
        }
    }

    /// Writes it into an experiment. A model corrects in the mode `interactive` alone, so that is chosen with it and left with it.
    pub fn write(self, experiment: &mut Experiment) {
        let was = Self::of(experiment);
        let horizon_s = experiment
            .control
            .interaction
            .map_or(HORIZON_S[1], |asked| asked.horizon_s);
        experiment.control.feedback_alone = self == Self::Nothing;
        experiment.control.interaction = (self == Self::Model).then_some(Interaction { horizon_s });
        match (was, self) {
            (_, Self::Model) => experiment.mode = Mode::Interactive,
            (Self::Model, _) => experiment.mode = Mode::Physical,
            _ => {}
        }
    }
}

/// Chooses who carries an experiment out; models correct in the mode `interactive` alone.
pub fn set_mode(experiment: &mut Experiment, mode: Mode) {
    experiment.mode = mode;
    if mode != Mode::Interactive {
        experiment.control.interaction = None;
    }
}

/// What made up for the errors of a run's only robot: `feedback alone`, `corrected by the model omni-01/2`.
pub fn of_run(view: &RunView) -> String {
    let version = view
        .experiment
        .robots
        .first()
        .and_then(|robot| view.models.get(&robot.name));
    match (Correction::of(&view.experiment), version) {
        (Correction::Nothing, _) => "feedback alone".to_owned(),
        (Correction::Delay, _) => "delay compensation".to_owned(),
        (Correction::Model, Some(version)) => format!("corrected by the model {version}"),
        (Correction::Model, None) => "corrected by the nominal model".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::Template;

    #[test]
    fn choosing_a_model_chooses_the_mode_and_leaving_it_leaves_both() {
        let mut experiment = Template::PaperPath.experiment();
        assert_eq!(Correction::of(&experiment), Correction::Nothing);
        Correction::Model.write(&mut experiment);
        assert_eq!(experiment.mode, Mode::Interactive);
        assert_eq!(experiment.control.interaction, Some(Interaction { horizon_s: 0.3 }));
        assert!(!experiment.control.feedback_alone);
        for correction in [Correction::Delay, Correction::Nothing] {
            let mut other = experiment.clone();
            correction.write(&mut other);
            assert_eq!((Correction::of(&other), other.mode), (correction, Mode::Physical));
            assert_eq!(other.control.interaction, None);
        }
        set_mode(&mut experiment, Mode::Virtual);
        assert_eq!(Correction::of(&experiment), Correction::Delay);
    }

    #[test]
    fn a_chosen_horizon_stays() {
        let mut experiment = Template::PaperPath.experiment();
        experiment.mode = Mode::Interactive;
        experiment.control.feedback_alone = false;
        experiment.control.interaction = Some(Interaction { horizon_s: 0.2 });
        Correction::Model.write(&mut experiment);
        assert_eq!(experiment.control.interaction, Some(Interaction { horizon_s: 0.2 }));
    }
}
