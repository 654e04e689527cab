//! Kinds of value made of other kinds: lists, values that may be left out, tables.

use super::kind::wrong_type;
use super::{
    Kind, Node, Place, SettingError, Table, TableDescription, Value, describe_table, read_table,
};

/// Several values of one kind.
pub(crate) struct Several<K, const COUNT: usize>(K);

/// Exactly `COUNT` values of one kind.
pub(crate) fn several<const COUNT: usize, K: Kind>(kind: K) -> Several<K, COUNT> {
    Several(kind)
}

impl<K: Kind<Value: Copy + Default>, const COUNT: usize> Kind for Several<K, COUNT> {
    type Value = [K::Value; COUNT];

    fn read(&self, key: &str, node: &Node) -> Result<Self::Value, SettingError> {
        let Value::List(items) = &node.value else { return Err(wrong_type(self, key, node)) };
        if items.len() != COUNT {
            return Err(wrong_type(self, key, node));
        }
        let mut values = [K::Value::default(); COUNT];
        for (value, item) in values.iter_mut().zip(items) {
            *value = self.0.read(key, item)?;
        }
        Ok(values)
    }

    fn unit(&self) -> &'static str {
        self.0.unit()
    }

    fn type_text(&self) -> String {
        format!("a list of {COUNT}, each {}", self.0.type_text())
    }

    fn value_text(&self, values: &Self::Value) -> String {
        let texts: Vec<_> = values.iter().map(|value| self.0.value_text(value)).collect();
        format!("[{}]", texts.join(", "))
    }

    fn range_text(&self) -> String {
        self.0.range_text()
    }
}

/// Any number of values of one kind.
pub(crate) struct Each<K>(K);

/// Any number of values of one kind.
pub(crate) fn each<K: Kind>(kind: K) -> Each<K> {
    Each(kind)
}

impl<K: Kind> Kind for Each<K> {
    type Value = Vec<K::Value>;

    fn read(&self, key: &str, node: &Node) -> Result<Self::Value, SettingError> {
        let Value::List(items) = &node.value else { return Err(wrong_type(self, key, node)) };
        items.iter().map(|item| self.0.read(key, item)).collect()
    }

    fn unit(&self) -> &'static str {
        self.0.unit()
    }

    fn type_text(&self) -> String {
        format!("a list, each {}", self.0.type_text())
    }

    fn value_text(&self, values: &Self::Value) -> String {
        let texts: Vec<_> = values.iter().map(|value| self.0.value_text(value)).collect();
        format!("[{}]", texts.join(", "))
    }

    fn range_text(&self) -> String {
        self.0.range_text()
    }
}

/// A key that may be left out.
pub(crate) struct Optional<K>(K);

/// A key that may be left out; its documentation says what happens then.
pub(crate) fn optional<K: Kind>(kind: K) -> Optional<K> {
    Optional(kind)
}

impl<K: Kind> Kind for Optional<K> {
    type Value = Option<K::Value>;

    fn read(&self, key: &str, node: &Node) -> Result<Self::Value, SettingError> {
        self.0.read(key, node).map(Some)
    }

    fn unit(&self) -> &'static str {
        self.0.unit()
    }

    fn type_text(&self) -> String {
        self.0.type_text()
    }

    fn value_text(&self, value: &Self::Value) -> String {
        value.as_ref().map_or("unset".to_owned(), |value| self.0.value_text(value))
    }

    fn range_text(&self) -> String {
        self.0.range_text()
    }

    fn choices_text(&self) -> String {
        self.0.choices_text()
    }

    fn describe_tables(&self, path: &str, below: &mut Vec<TableDescription>) {
        self.0.describe_tables(path, below);
    }
}

/// Something read, and its place for the checks that follow.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Placed<T> {
    /// Where it was written.
    pub place: Place,
    /// What was written.
    pub value: T,
}

/// A value that remembers its place.
pub(crate) struct WithPlace<K>(K);

/// A value that remembers its place.
pub(crate) fn placed<K: Kind>(kind: K) -> WithPlace<K> {
    WithPlace(kind)
}

impl<K: Kind> Kind for WithPlace<K> {
    type Value = Placed<K::Value>;

    fn read(&self, key: &str, node: &Node) -> Result<Self::Value, SettingError> {
        Ok(Placed { place: node.place.clone(), value: self.0.read(key, node)? })
    }

    fn unit(&self) -> &'static str {
        self.0.unit()
    }

    fn type_text(&self) -> String {
        self.0.type_text()
    }

    fn value_text(&self, value: &Self::Value) -> String {
        self.0.value_text(&value.value)
    }

    fn range_text(&self) -> String {
        self.0.range_text()
    }

    fn choices_text(&self) -> String {
        self.0.choices_text()
    }

    fn describe_tables(&self, path: &str, below: &mut Vec<TableDescription>) {
        self.0.describe_tables(path, below);
    }
}

/// A table of settings.
pub(crate) struct One<T>(std::marker::PhantomData<T>);

/// A table of settings.
pub(crate) fn table<T: Table>() -> One<T> {
    One(std::marker::PhantomData)
}

impl<T: Table> Kind for One<T> {
    type Value = T;

    fn read(&self, key: &str, node: &Node) -> Result<T, SettingError> {
        read_table(key, node)
    }

    fn type_text(&self) -> String {
        "a table".to_owned()
    }

    fn value_text(&self, _: &T) -> String {
        "all defaults".to_owned()
    }

    fn describe_tables(&self, path: &str, below: &mut Vec<TableDescription>) {
        below.extend(describe_table::<T>(path, false));
    }
}

/// Any number of tables.
pub(crate) struct Many<T>(std::marker::PhantomData<T>);

/// Any number of tables.
pub(crate) fn tables<T: Table>() -> Many<T> {
    Many(std::marker::PhantomData)
}

impl<T: Table> Kind for Many<T> {
    type Value = Vec<Placed<T>>;

    fn read(&self, key: &str, node: &Node) -> Result<Self::Value, SettingError> {
        let Value::List(items) = &node.value else { return Err(wrong_type(self, key, node)) };
        let read =
            |item: &Node| Ok(Placed { place: item.place.clone(), value: read_table(key, item)? });
        items.iter().map(read).collect()
    }

    fn type_text(&self) -> String {
        "a list of tables".to_owned()
    }

    fn value_text(&self, _: &Self::Value) -> String {
        "none".to_owned()
    }

    fn describe_tables(&self, path: &str, below: &mut Vec<TableDescription>) {
        below.extend(describe_table::<T>(path, true));
    }
}
