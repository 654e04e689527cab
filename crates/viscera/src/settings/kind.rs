//! The kinds of value that a setting can take: how one is read, checked, printed and described.
//! Kinds made of other kinds are in `compound.rs`.

use super::{
    Node, SettingError, TableDescription, Value, ValueError, suggest, tidy_doc, value_error,
};
use crate::scalar::{Vec3, vec3};
use crate::units::{Dimension, format_number};

/// A kind of value.
pub(crate) trait Kind {
    /// The type of a field of this kind.
    type Value;
    /// Reads and checks a value.
    fn read(&self, key: &str, node: &Node) -> Result<Self::Value, SettingError>;
    /// The form of its values, in words.
    fn type_text(&self) -> String;
    /// The default as one would write it.
    fn value_text(&self, value: &Self::Value) -> String;
    /// Its limits; empty where there are none.
    fn range_text(&self) -> String {
        String::new()
    }
    /// The meaning of each name; empty where there are none.
    fn choices_text(&self) -> String {
        String::new()
    }
    /// The SI unit of its numbers; empty where they have none.
    fn unit(&self) -> &'static str {
        ""
    }
    /// Adds the descriptions of the tables below.
    fn describe_tables(&self, _path: &str, _below: &mut Vec<TableDescription>) {}
}

/// The error of a value of another type.
pub(super) fn wrong_type<K: Kind>(kind: &K, key: &str, node: &Node) -> SettingError {
    value_error(key, node, ValueError::Type { wanted: kind.type_text() })
}

/// An interval of numbers, its ends in or out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Range {
    low: f64,
    low_included: bool,
    high: f64,
    high_included: bool,
}

/// Every finite number.
pub(crate) const ANY: Range = Range {
    low: f64::NEG_INFINITY,
    low_included: false,
    high: f64::INFINITY,
    high_included: false,
};

/// Greater than `low`.
pub(crate) const fn above(low: f64) -> Range {
    Range { low, ..ANY }
}

/// `low` or greater.
pub(crate) const fn at_least(low: f64) -> Range {
    Range { low, low_included: true, ..ANY }
}

impl Range {
    /// And smaller than `high`.
    pub const fn below(self, high: f64) -> Self {
        Self { high, high_included: false, ..self }
    }

    /// And at most `high`.
    pub const fn up_to(self, high: f64) -> Self {
        Self { high, high_included: true, ..self }
    }

    fn contains(self, value: f64) -> bool {
        let above = value > self.low || (self.low_included && value == self.low);
        let below = value < self.high || (self.high_included && value == self.high);
        value.is_finite() && above && below
    }

    fn text(self, dimension: Dimension) -> String {
        let low = match (self.low.is_finite(), self.low_included) {
            (false, _) => String::new(),
            (true, true) => format!("at least {}", dimension.format(self.low)),
            (true, false) => format!("above {}", dimension.format(self.low)),
        };
        let high = match (self.high.is_finite(), self.high_included) {
            (false, _) => String::new(),
            (true, true) => format!("at most {}", dimension.format(self.high)),
            (true, false) => format!("below {}", dimension.format(self.high)),
        };
        match (low.is_empty(), high.is_empty()) {
            (false, false) => format!("{low} and {high}"),
            _ => low + &high,
        }
    }
}

/// A number with a dimension, in SI units once read.
pub(crate) struct Quantity {
    dimension: Dimension,
    range: Range,
    /// Refuses a value with a reason of its own, before the range is looked at.
    check: fn(f64) -> Result<(), String>,
}

/// A number with a dimension. Pure numbers may be written bare, everything else needs a unit.
pub(crate) fn quantity(dimension: Dimension, range: Range) -> Quantity {
    Quantity { dimension, range, check: |_| Ok(()) }
}

/// A pure number.
pub(crate) fn number(range: Range) -> Quantity {
    quantity(Dimension::Ratio, range)
}

impl Quantity {
    /// With a check that gives its own reason.
    pub fn checked(self, check: fn(f64) -> Result<(), String>) -> Self {
        Self { check, ..self }
    }
}

impl Kind for Quantity {
    type Value = f64;

    fn read(&self, key: &str, node: &Node) -> Result<f64, SettingError> {
        let fail = |problem| value_error(key, node, problem);
        let value = match &node.value {
            Value::Text(text) => self.dimension.parse(text).map_err(|error| fail(error.into()))?,
            // Zero is zero in every unit.
            Value::Whole(0) => 0.0,
            Value::Whole(whole) if self.dimension == Dimension::Ratio => *whole as f64,
            Value::Number(number) if self.dimension == Dimension::Ratio || *number == 0.0 => {
                *number
            }
            Value::Whole(_) | Value::Number(_) => {
                let example = self.dimension.example();
                return Err(fail(crate::units::UnitError::NoUnit { example }.into()));
            }
            _ => return Err(wrong_type(self, key, node)),
        };
        (self.check)(value).map_err(|reason| fail(ValueError::Impossible(reason)))?;
        if !self.range.contains(value) {
            let range = match self.range_text() {
                range if range.is_empty() => "a finite number".to_owned(),
                range => range,
            };
            return Err(fail(ValueError::Range { range }));
        }
        Ok(value)
    }

    fn unit(&self) -> &'static str {
        self.dimension.si_symbol()
    }

    fn type_text(&self) -> String {
        match self.dimension {
            Dimension::Ratio => "a number".to_owned(),
            dimension => format!("{dimension} such as \"{}\"", dimension.example()),
        }
    }

    fn value_text(&self, value: &f64) -> String {
        match self.dimension {
            Dimension::Ratio => format_number(*value),
            dimension => format!("\"{}\"", dimension.format(*value)),
        }
    }

    fn range_text(&self) -> String {
        self.range.text(self.dimension)
    }
}

/// A whole number.
pub(crate) struct Whole(u32, u32);

/// A whole number from `low` to `high`.
pub(crate) const fn whole(low: u32, high: u32) -> Whole {
    Whole(low, high)
}

impl Kind for Whole {
    type Value = u32;

    fn read(&self, key: &str, node: &Node) -> Result<u32, SettingError> {
        let Value::Whole(value) = node.value else { return Err(wrong_type(self, key, node)) };
        match u32::try_from(value) {
            Ok(value) if (self.0..=self.1).contains(&value) => Ok(value),
            _ => Err(value_error(key, node, ValueError::Range { range: self.range_text() })),
        }
    }

    fn type_text(&self) -> String {
        "a whole number".to_owned()
    }

    fn value_text(&self, value: &u32) -> String {
        value.to_string()
    }

    fn range_text(&self) -> String {
        match self.1 {
            u32::MAX => format!("at least {}", self.0),
            high => format!("{} to {high}", self.0),
        }
    }
}

/// Three quantities of one dimension, along x, y and z.
pub(crate) struct Vector(Dimension);

/// A vector, each component with its unit.
pub(crate) fn vector(dimension: Dimension) -> Vector {
    Vector(dimension)
}

impl Kind for Vector {
    type Value = Vec3<f64>;

    fn read(&self, key: &str, node: &Node) -> Result<Vec3<f64>, SettingError> {
        let Value::List(items) = &node.value else { return Err(wrong_type(self, key, node)) };
        let [x, y, z] = items.as_slice() else { return Err(wrong_type(self, key, node)) };
        let component = quantity(self.0, ANY);
        Ok(vec3(component.read(key, x)?, component.read(key, y)?, component.read(key, z)?))
    }

    fn unit(&self) -> &'static str {
        self.0.si_symbol()
    }

    fn type_text(&self) -> String {
        match self.0 {
            Dimension::Ratio => "three numbers [x, y, z]".to_owned(),
            dimension => {
                format!("a list of three such as [\"{}\", 0, 0]", dimension.example())
            }
        }
    }

    fn value_text(&self, value: &Vec3<f64>) -> String {
        let component = quantity(self.0, ANY);
        let text = |value: f64| match value {
            0.0 => "0".to_owned(),
            value => component.value_text(&value),
        };
        format!("[{}, {}, {}]", text(value.x), text(value.y), text(value.z))
    }
}

/// Three numbers that point somewhere; of length 1 once read.
pub(crate) struct Direction;

/// A direction, of any length but zero.
pub(crate) fn direction() -> Direction {
    Direction
}

impl Kind for Direction {
    type Value = Vec3<f64>;

    fn read(&self, key: &str, node: &Node) -> Result<Vec3<f64>, SettingError> {
        let value = vector(Dimension::Ratio).read(key, node)?;
        // By its largest component first: the square of 1e200 is not finite.
        let largest = value.x.abs().max(value.y.abs()).max(value.z.abs());
        let scaled = vec3(value.x / largest, value.y / largest, value.z / largest);
        if largest == 0.0 || !scaled.is_finite() {
            let reason = "a direction needs a component that is not zero, for example [0, 0, 1]";
            return Err(value_error(key, node, ValueError::Impossible(reason.to_owned())));
        }
        Ok(scaled * (1.0 / scaled.length()))
    }

    fn type_text(&self) -> String {
        "a direction [x, y, z] of any length".to_owned()
    }

    fn value_text(&self, value: &Vec3<f64>) -> String {
        vector(Dimension::Ratio).value_text(value)
    }
}

/// True or false.
pub(crate) struct Truth;

/// True or false.
pub(crate) fn truth() -> Truth {
    Truth
}

impl Kind for Truth {
    type Value = bool;

    fn read(&self, key: &str, node: &Node) -> Result<bool, SettingError> {
        match node.value {
            Value::Truth(truth) => Ok(truth),
            _ => Err(wrong_type(self, key, node)),
        }
    }

    fn type_text(&self) -> String {
        "true or false".to_owned()
    }

    fn value_text(&self, value: &bool) -> String {
        value.to_string()
    }
}

/// Text: any, or a name.
pub(crate) struct Text {
    is_name: bool,
}

/// Any text.
pub(crate) fn text() -> Text {
    Text { is_name: false }
}

/// A name: it stands in the keys of overrides and in tables of results.
pub(crate) fn name() -> Text {
    Text { is_name: true }
}

impl Kind for Text {
    type Value = String;

    fn read(&self, key: &str, node: &Node) -> Result<String, SettingError> {
        let Value::Text(text) = &node.value else { return Err(wrong_type(self, key, node)) };
        let allowed = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == '-';
        let all_digits = text.chars().all(|letter| letter.is_ascii_digit());
        if self.is_name && (all_digits || !text.chars().all(allowed)) {
            return Err(value_error(key, node, ValueError::Range { range: self.range_text() }));
        }
        Ok(text.clone())
    }

    fn type_text(&self) -> String {
        if self.is_name { "a name in quotes" } else { "text in quotes" }.to_owned()
    }

    fn value_text(&self, value: &String) -> String {
        format!("\"{value}\"")
    }

    fn range_text(&self) -> String {
        match self.is_name {
            true => "letters, digits, - and _, not digits alone".to_owned(),
            false => String::new(),
        }
    }
}

/// An enum whose variants have names; implemented by `choices!` only.
pub(crate) trait Choice: Copy + PartialEq + 'static {
    /// Variant, name and documentation.
    const ALL: &'static [(Self, &'static str, &'static str)];
}

/// One of a few names.
pub(crate) struct OneOf<T>(std::marker::PhantomData<T>);

/// One of the names of an enum.
pub(crate) fn one_of<T: Choice>() -> OneOf<T> {
    OneOf(std::marker::PhantomData)
}

impl<T: Choice> Kind for OneOf<T> {
    type Value = T;

    fn read(&self, key: &str, node: &Node) -> Result<T, SettingError> {
        let Value::Text(text) = &node.value else { return Err(wrong_type(self, key, node)) };
        if let Some((value, ..)) = T::ALL.iter().find(|(_, name, _)| name == text) {
            return Ok(*value);
        }
        let names: Vec<_> = T::ALL.iter().map(|(_, name, _)| *name).collect();
        let hint = match suggest(text, &names) {
            all if all.starts_with("valid") => all,
            nearest => format!("{nearest} Valid: {}", names.join(", ")),
        };
        Err(value_error(key, node, ValueError::Choice { hint }))
    }

    fn type_text(&self) -> String {
        let names: Vec<_> = T::ALL.iter().map(|(_, name, _)| format!("\"{name}\"")).collect();
        names.join(" or ")
    }

    fn value_text(&self, value: &T) -> String {
        let named = T::ALL.iter().find(|(known, ..)| known == value);
        named.map_or(String::new(), |(_, name, _)| format!("\"{name}\""))
    }

    fn choices_text(&self) -> String {
        let text = |(_, name, doc): &(T, &str, &str)| format!("`{name}`: {}", tidy_doc(doc));
        T::ALL.iter().map(text).collect::<Vec<_>>().join(" ")
    }
}
