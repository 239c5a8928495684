//! Which of views and steps follow one another in a stack.

use beamlet_core::options::{Choice, Word};
use serde::{Deserialize, Serialize};

/// Order of the frames of a stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum FrameOrder {
    /// All steps of a view, then the next view.
    #[default]
    #[serde(rename = "view,step")]
    ViewStep,
    /// All views of a step, then the next step: a turn for each mask step.
    #[serde(rename = "step,view")]
    StepView,
}

impl FrameOrder {
    /// Index of a frame of `views` views of `steps` steps each.
    pub(super) const fn index(self, [view, step]: [usize; 2], [views, steps]: [usize; 2]) -> usize {
        match self {
            Self::ViewStep => view * steps + step,
            Self::StepView => step * views + view,
        }
    }
}

impl Choice for FrameOrder {
    const CHOICES: &'static [Self] = &[Self::ViewStep, Self::StepView];

    fn word(self) -> Word {
        match self {
            Self::ViewStep => {
                Word { name: "view,step", help: "All steps of a view, then the next view" }
            }
            Self::StepView => Word {
                name: "step,view",
                help: "All views of a step, then the next step: a turn, or a folder, for each mask step",
            },
        }
    }
}
