//! The device that computes.

use super::{Kind, Node, SettingError, Value, ValueError, value_error, wrong_type};

/// The device that computes a simulation's steps.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceRequest {
    /// The device that is expected to be faster; the CPU where no GPU can do it.
    Auto,
    /// The processor.
    Cpu,
    /// The first graphics adapter; without one nothing is computed.
    Gpu,
    /// The first adapter whose name contains this text, whatever its case.
    Named(String),
}

/// Reads what computes the steps.
pub(super) struct DeviceNames;

impl Kind for DeviceNames {
    type Value = DeviceRequest;

    fn read(&self, key: &str, node: &Node) -> Result<DeviceRequest, SettingError> {
        let Value::Text(text) = &node.value else { return Err(wrong_type(self, key, node)) };
        // No adapter has these letters, and without them a name is recorded as it was written.
        let is_strange = |letter: char| letter.is_control() || "\"\\".contains(letter);
        if text.trim().is_empty() || text.contains(is_strange) {
            return Err(value_error(key, node, ValueError::Range { range: self.range_text() }));
        }
        Ok(match text.as_str() {
            "auto" => DeviceRequest::Auto,
            "cpu" => DeviceRequest::Cpu,
            "gpu" => DeviceRequest::Gpu,
            name => DeviceRequest::Named(name.to_owned()),
        })
    }

    fn type_text(&self) -> String {
        "\"auto\", \"cpu\", \"gpu\" or part of an adapter's name".to_owned()
    }

    fn value_text(&self, value: &DeviceRequest) -> String {
        format!("\"{value}\"")
    }

    fn range_text(&self) -> String {
        "a name without quotes and backslashes".to_owned()
    }
}

impl std::fmt::Display for DeviceRequest {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Cpu => "cpu",
            Self::Gpu => "gpu",
            Self::Named(name) => name,
        })
    }
}
