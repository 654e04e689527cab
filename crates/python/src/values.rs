//! Values of settings, from Python to what a scene file has and back.

use crate::fault::{Class, error};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyList, PyMapping, PyString};
use viscera::settings::SettingValue;

/// More of a list within a list than any setting has.
const DEEPEST: usize = 8;

/// The SI unit of the numbers at a key; empty where they have none.
pub type UnitOf<'a> = &'a dyn Fn(&str) -> &'static str;

/// A value as a scene file has it on the right of an equals sign: numbers get the unit of their key.
pub fn to_text(key: &str, value: &Bound<'_, PyAny>, unit: UnitOf<'_>) -> PyResult<String> {
    text_of(key, value, unit, DEEPEST)
}

fn text_of(key: &str, value: &Bound<'_, PyAny>, unit: UnitOf<'_>, deep: usize) -> PyResult<String> {
    let refuse = || {
        let kind = value.get_type().name().map_or("?".to_owned(), |name| name.to_string());
        let wanted = "give text with a unit such as \"6.5 kPa\", a number in SI units, True, False, or a list of these";
        error(Class::Scene, format!("{key}: a setting cannot be a {kind}; {wanted}"))
    };
    if deep == 0 {
        return Err(refuse());
    }
    if let Ok(truth) = value.cast::<PyBool>() {
        return Ok(truth.is_true().to_string());
    }
    if value.is_instance_of::<PyInt>() {
        return Ok(with_unit(value.str()?.to_string(), unit(key)));
    }
    if value.is_instance_of::<PyFloat>() {
        return Ok(with_unit(number_text(value.extract()?), unit(key)));
    }
    if let Ok(text) = value.cast::<PyString>() {
        return Ok(quoted(text.to_str()?));
    }
    if let Ok(table) = value.cast::<PyMapping>() {
        let entry = |item: Bound<'_, PyAny>| -> PyResult<String> {
            let (name, value): (Bound<'_, PyAny>, Bound<'_, PyAny>) = item.extract()?;
            let name: String = name.extract().map_err(|_| refuse())?;
            let text = text_of(&format!("{key}.{name}"), &value, unit, deep - 1)?;
            Ok(format!("{} = {text}", quoted(&name)))
        };
        let entries: PyResult<Vec<String>> = table.items()?.iter().map(entry).collect();
        return Ok(format!("{{ {} }}", entries?.join(", ")));
    }
    // Numbers and arrays of NumPy.
    for name in ["tolist", "item"] {
        if value.hasattr(name)? && !value.hasattr("keys")? {
            let plain = value.call_method0(name)?;
            return text_of(key, &plain, unit, deep - 1);
        }
    }
    match value.try_iter() {
        Ok(items) if value.hasattr("__len__")? => {
            let items: PyResult<Vec<String>> =
                items.map(|item| text_of(key, &item?, unit, deep - 1)).collect();
            Ok(format!("[{}]", items?.join(", ")))
        }
        _ => Err(refuse()),
    }
}

/// What is no number is left bare: it is refused as what it is.
fn with_unit(number: String, unit: &str) -> String {
    match unit.is_empty() || number.ends_with("nan") || number.ends_with("inf") {
        true => number,
        false => quoted(&format!("{number} {unit}")),
    }
}

/// With a point or an exponent, so that it is not read as a whole number; NaN and infinity as TOML writes them.
fn number_text(number: f64) -> String {
    match number {
        _ if number.is_nan() => "nan".to_owned(),
        _ if number.is_infinite() => if number > 0.0 { "inf" } else { "-inf" }.to_owned(),
        _ => format!("{number:?}"),
    }
}

/// As TOML quotes text.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for letter in text.chars() {
        match letter {
            '"' | '\\' => quoted.extend(['\\', letter]),
            control if control.is_control() => {
                quoted.push_str(&format!("\\U{:08x}", u32::from(control)));
            }
            plain => quoted.push(plain),
        }
    }
    quoted.push('"');
    quoted
}

/// A value of a scene file, for Python.
pub fn to_python<'py>(py: Python<'py>, value: &SettingValue) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        SettingValue::Text(text) => text.into_pyobject(py)?.into_any(),
        SettingValue::Whole(number) => number.into_pyobject(py)?.into_any(),
        SettingValue::Number(number) => number.into_pyobject(py)?.into_any(),
        SettingValue::Truth(truth) => truth.into_pyobject(py)?.to_owned().into_any(),
        SettingValue::List(items) => {
            let items: PyResult<Vec<_>> = items.iter().map(|item| to_python(py, item)).collect();
            PyList::new(py, items?)?.into_any()
        }
        SettingValue::Table(entries) => {
            let table = PyDict::new(py);
            for (name, entry) in entries {
                table.set_item(name, to_python(py, entry)?)?;
            }
            table.into_any()
        }
    })
}
