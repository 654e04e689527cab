//! The accuracy that a method chooses its steps for.

use super::kind::Quantity;
use super::{Kind, Node, SettingError, Value, ValueError, at_least, number, value_error};

/// The error of motion that is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accuracy {
    /// For a first look.
    Draft,
    /// What one does not see.
    Standard,
    /// For comparisons.
    Fine,
    /// A share of the displacement, from [`FINEST`] to [`ROUGHEST`].
    Share(f64),
}

/// The least error of motion that can be asked for.
pub const FINEST: f64 = 1e-3;

/// The largest error of motion that can be asked for.
pub const ROUGHEST: f64 = 0.3;

impl Accuracy {
    const NAMED: [(&'static str, Self); 3] =
        [("draft", Self::Draft), ("standard", Self::Standard), ("fine", Self::Fine)];

    /// As a share of the displacement.
    pub fn share(self) -> f64 {
        match self {
            Self::Draft => 0.15,
            Self::Standard => 0.05,
            Self::Fine => 0.005,
            Self::Share(share) => share,
        }
    }
}

/// Reads an accuracy.
pub(super) struct Accuracies;

fn shares() -> Quantity {
    number(at_least(FINEST).up_to(ROUGHEST))
}

impl Kind for Accuracies {
    type Value = Accuracy;

    fn read(&self, key: &str, node: &Node) -> Result<Accuracy, SettingError> {
        let share = shares().read(key, node).map(Accuracy::Share);
        let (Value::Text(text), Err(_)) = (&node.value, &share) else { return share };
        let named = Accuracy::NAMED.into_iter().find(|(name, _)| name == text);
        named.map(|(_, accuracy)| accuracy).ok_or_else(|| {
            let hint =
                "write \"draft\", \"standard\", \"fine\", or a number such as 0.02".to_owned();
            value_error(key, node, ValueError::Choice { hint })
        })
    }

    fn type_text(&self) -> String {
        "\"draft\", \"standard\", \"fine\" or a number".to_owned()
    }

    fn value_text(&self, value: &Accuracy) -> String {
        let named = Accuracy::NAMED.into_iter().find(|(_, accuracy)| accuracy == value);
        named.map_or_else(|| value.share().to_string(), |(name, _)| format!("\"{name}\""))
    }

    fn range_text(&self) -> String {
        shares().range_text()
    }
}

impl std::fmt::Display for Accuracy {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&Accuracies.value_text(self))
    }
}
