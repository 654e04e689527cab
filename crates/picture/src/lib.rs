//! Software renderer: pictures of deformed tissue with no GPU and no display.
